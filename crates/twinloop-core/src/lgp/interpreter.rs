//! The interpreter: runs steps over a bank of registers, one vector register after another.

use super::operation::Operation;
use crate::lanes::Vector;

/// One step: constants are registers behind those of the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub(super) struct Step {
    pub destination: u16,
    pub first: u16,
    pub second: u16,
    pub operation: Operation,
}

/// `bank[destination] = bank[first] operation bank[second]` for each step in order.
///
/// # Safety
/// Every register that a step names must be one of the bank.
#[inline(always)]
#[allow(unsafe_code)]
pub(super) unsafe fn interpret<V: Vector>(steps: &[Step], bank: &mut [V]) {
    for step in steps {
        macro_rules! arms {
            ($($operation:ident)*) => {
                // The operation is constant in each arm, which leaves only its own instructions there.
                match step.operation {
                    // SAFETY: the caller's promise is passed on.
                    $(Operation::$operation => unsafe { apply(Operation::$operation, step, bank) },)*
                }
            };
        }
        arms!(Add Sub Mul Div Min Max Sin Cos Tanh Exp Sqrt Abs);
    }
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
