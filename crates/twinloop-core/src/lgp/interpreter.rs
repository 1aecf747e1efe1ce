//! The interpreter: runs steps over a bank of registers, one vector register after another.

use super::operation::Operation;
use crate::lanes::Vector;

/// One step: constants are registers behind those of the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub(super) struct Step {
    destination: u16,
    first: u16,
    second: u16,
    operation: Operation,
    kind: Kind,
}

impl Step {
    /// An operation on two registers, behind the step `before`; on one of them, if it has one operand only.
    pub fn new(
        operation: Operation,
        destination: u16,
        [first, second]: [u16; 2],
        before: Option<&Self>,
    ) -> Self {
        let last = before.map(|step| step.destination);
        let kind = Kind::new(operation, last == Some(first), last == Some(second));
        Self { destination, first, second, operation, kind }
    }
}

/// Defines the kinds of steps and the loop over them, of all operations and of those that programs mostly consist of.
macro_rules! kinds {
    ($($operation:ident)*; $($common:ident: $with_first:ident $with_second:ident,)*) => {
        /// An operation, and whether one of its operands is the result of the step before.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[repr(u8)]
        enum Kind {
            $($operation,)*
            $($with_first, $with_second,)*
        }

        impl Kind {
            fn new(operation: Operation, first_is_last: bool, second_is_last: bool) -> Self {
                match operation {
                    $(Operation::$common if first_is_last => Self::$with_first,)*
                    $(Operation::$common if second_is_last => Self::$with_second,)*
                    $(Operation::$operation => Self::$operation,)*
                }
            }
        }

        /// Each step on the whole vector.
        ///
        /// A result that is read back from the bank at once is waited for several times as long as an addition takes. So
        /// the last one is passed on beside the bank too.
        #[inline(always)]
        #[allow(unsafe_code)]
        unsafe fn narrow<V: Vector>(steps: &[Step], bank: &mut [V]) {
            let mut last = V::splat(0.0);
            for &Step { destination, first, second, kind, .. } in steps {
                debug_assert!([destination, first, second].iter().all(|&number| usize::from(number) < bank.len()));
                // The operation is constant in each arm, which leaves only its own instructions there.
                // SAFETY: the caller promises registers of the bank. Checking three of them at each step costs a fifth of
                // it.
                unsafe {
                    last = match kind {
                        $(Kind::$operation => {
                            Operation::$operation.apply(register(bank, first), register(bank, second))
                        })*
                        $(Kind::$with_first => Operation::$common.apply(last, register(bank, second)),)*
                        $(Kind::$with_second => Operation::$common.apply(register(bank, first), last),)*
                    };
                    *bank.get_unchecked_mut(usize::from(destination)) = last;
                }
            }
        }

        /// Each step on a piece of the vector after another: all of them would not fit into the processor's registers, and
        /// while one is waited for there are others to be computed.
        #[inline(always)]
        #[allow(unsafe_code)]
        unsafe fn wide<V: Vector>(steps: &[Step], bank: &mut [V]) {
            for step in steps {
                match step.operation {
                    // SAFETY: the caller's promise is passed on.
                    $(Operation::$operation => unsafe { apply(Operation::$operation, step, bank) },)*
                }
            }
        }
    };
}
kinds!(
    Add Sub Mul Div Min Max Sin Cos Tanh Exp Sqrt Abs;
    Add: LastAdd AddLast,
    Sub: LastSub SubLast,
    Mul: LastMul MulLast,
    Div: LastDiv DivLast,
);

/// `bank[destination] = bank[first] operation bank[second]` for each step in order.
///
/// # Safety
/// Every register that a step names must be one of the bank.
#[inline(always)]
#[allow(unsafe_code)]
pub(super) unsafe fn interpret<V: Vector>(steps: &[Step], bank: &mut [V]) {
    // SAFETY: the caller's promise is passed on.
    if V::PIECES <= 2 { unsafe { narrow(steps, bank) } } else { unsafe { wide(steps, bank) } }
}

#[inline(always)]
#[allow(unsafe_code)]
unsafe fn register<V: Vector>(bank: &[V], number: u16) -> V {
    // SAFETY: the caller promises a register of the bank.
    unsafe { *bank.get_unchecked(usize::from(number)) }
}

#[inline(always)]
#[allow(unsafe_code)]
unsafe fn apply<V: Vector>(operation: Operation, step: &Step, bank: &mut [V]) {
    let Step { destination, first, second, .. } = *step;
    debug_assert!([destination, first, second].iter().all(|&register| usize::from(register) < bank.len()));
    for piece in 0..V::PIECES {
        // SAFETY: the caller promises registers of the bank. Checking three of them at each step costs a fifth of it.
        unsafe {
            let (a, b) = (bank.get_unchecked(usize::from(first)), bank.get_unchecked(usize::from(second)));
            let result = operation.apply(a.piece(piece), b.piece(piece));
            bank.get_unchecked_mut(usize::from(destination)).set_piece(piece, result);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::{Scalar, Wide};

    /// What a step computes from 3.5 and −0.75, of which the step before it has computed the `last` ones.
    #[allow(unsafe_code)]
    fn computed<V: Vector>(operation: Operation, last: [bool; 2]) -> f64 {
        let mut bank = [3.5, -0.75, 0.0, 0.0, 0.0].map(V::splat);
        // The step before copies its operand, or both of them in turn, to where it is read.
        let copy =
            |from: u16, before: Option<&Step>| Step::new(Operation::Max, 2 + from, [from, from], before);
        let mut steps = vec![];
        let order = if last[1] { [0, 1] } else { [1, 0] };
        for from in order {
            steps.push(copy(from, steps.last()));
        }
        if last == [false, false] {
            steps.push(Step::new(Operation::Max, 4, [0, 0], steps.last()));
        }
        let step = Step::new(operation, 4, [2, 3], steps.last());
        let plain = Step::new(operation, 4, [2, 3], None);
        assert!(
            last == [false, false] || operation as usize > Operation::Div as usize || step.kind != plain.kind
        );
        steps.push(step);
        // SAFETY: there are five registers.
        unsafe { interpret(&steps, &mut bank) };
        bank[4].lane(V::LANES - 1)
    }

    #[test]
    fn a_result_that_is_passed_on_is_the_operand_that_it_was() {
        for operation in Operation::ALL {
            let expected = operation.apply(Scalar::splat(3.5), Scalar::splat(-0.75)).lane(0);
            for last in [[false, false], [true, false], [false, true]] {
                assert_eq!(computed::<Scalar>(operation, last), expected, "{operation:?}, {last:?}");
                assert_eq!(computed::<Wide<f64, 2>>(operation, last), expected, "{operation:?}, {last:?}");
                assert_eq!(computed::<Wide<f64, 4>>(operation, last), expected, "{operation:?}, {last:?}");
            }
        }
    }
}
