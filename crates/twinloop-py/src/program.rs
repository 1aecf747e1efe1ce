//! Programs and the grammar that makes them.

use std::sync::Arc;

use numpy::PyArray2;
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::{PyFloat, PyTuple};
use twinloop_core::{
    Grammar, Instruction, Learnt, Operand, Operation, Page, Program, Purpose, Shape, Stream, Variation,
    run_rows,
};

use crate::arrays::{Matrix, rows, to_matrix, views};
use crate::error::{Result, given, misuse};
use crate::workers::{PyWorkers, or_default};

/// Pages of instructions over registers: inputs first, then outputs, then spare ones.
#[pyclass(frozen, eq, name = "Program", module = "twinloop._core")]
pub struct PyProgram(pub Arc<Learnt>);

impl PartialEq for PyProgram {
    fn eq(&self, other: &Self) -> bool {
        self.0.program == other.0.program
    }
}

impl From<Program> for PyProgram {
    fn from(program: Program) -> Self {
        Self(Arc::new(Learnt::new(program)))
    }
}

/// Operation, destination, first operand, second operand, as `PyProgram::instructions` gives them.
type InstructionParts<'py> = (String, i64, i64, Option<Bound<'py, PyAny>>);

#[pymethods]
impl PyProgram {
    #[new]
    fn new(
        #[pyo3(from_py_with = given)] inputs: usize,
        #[pyo3(from_py_with = given)] outputs: usize,
        #[pyo3(from_py_with = given)] registers: usize,
        #[pyo3(from_py_with = given)] pages: Vec<Vec<InstructionParts<'_>>>,
    ) -> Result<Self> {
        let Some(spare) = registers.checked_sub(inputs.saturating_add(outputs)) else {
            return Err(misuse(format!(
                "program: expected registers for {inputs} inputs and {outputs} outputs, found {registers}"
            )));
        };
        let shape = Shape::new(inputs, outputs, spare)?;
        let page = |page: Vec<_>| Ok(Page(page.into_iter().map(instruction).collect::<Result<_>>()?));
        Ok(Program::new(shape, pages.into_iter().map(page).collect::<Result<_>>()?)?.into())
    }

    #[staticmethod]
    fn parse(text: &str) -> Result<Self> {
        Ok(text.parse::<Program>()?.into())
    }

    #[getter]
    fn inputs(&self) -> usize {
        self.0.program.shape().inputs
    }

    #[getter]
    fn outputs(&self) -> usize {
        self.0.program.shape().outputs
    }

    #[getter]
    fn registers(&self) -> usize {
        self.0.program.shape().registers
    }

    #[getter]
    fn page_lengths(&self) -> Vec<usize> {
        self.0.program.pages().iter().map(|page| page.0.len()).collect()
    }

    #[getter]
    fn instructions<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyTuple>>> {
        let tuple = |instruction: &twinloop_core::Instruction| {
            let second = match instruction.second {
                None => py.None(),
                Some(Operand::Register(register)) => register.into_py_any(py)?,
                Some(Operand::Constant(constant)) => constant.into_py_any(py)?,
            };
            (instruction.operation.name(), instruction.destination, instruction.first, second)
                .into_pyobject(py)
        };
        self.0.program.instructions().map(tuple).collect()
    }

    #[getter]
    fn intron_share(&self) -> f64 {
        self.0.program.intron_share()
    }

    fn effective(&self) -> Self {
        self.0.program.effective().into()
    }

    #[pyo3(signature = (inputs, workers = None))]
    fn run<'py>(
        &self,
        py: Python<'py>,
        inputs: Matrix<'py>,
        workers: Option<&PyWorkers>,
    ) -> Result<Bound<'py, PyArray2<f64>>> {
        let workers = or_default(workers)?;
        let inputs = rows("inputs", &inputs, self.inputs())?;
        let outputs = py.detach(|| run_rows(&self.0.code, &views(&inputs), workers.width()));
        Ok(to_matrix(py, self.outputs(), outputs))
    }

    fn __len__(&self) -> usize {
        self.0.program.len()
    }

    fn __str__(&self) -> String {
        self.0.program.to_string()
    }

    fn __repr__(&self) -> String {
        format!("<Program of {} instructions, {} of them effective>", self.0.program.len(), self.0.code.len())
    }
}

fn instruction((operation, destination, first, second): InstructionParts<'_>) -> Result<Instruction> {
    let operand = |value: Bound<'_, PyAny>| -> Result<Operand> {
        match value.cast::<PyFloat>() {
            Ok(constant) => Ok(Operand::Constant(constant.value())),
            Err(_) => Ok(Operand::Register(register(value.extract().unwrap_or(-1))?)),
        }
    };
    Ok(Instruction {
        operation: operation.parse()?,
        destination: register(destination)?,
        first: register(first)?,
        second: second.map(operand).transpose()?,
    })
}

fn register(number: i64) -> Result<u16> {
    let register = u16::try_from(number);
    register.map_err(|_| misuse(format!("instruction: expected the number of a register, found {number}")))
}

/// What programs may look like and how they vary.
#[pyclass(frozen, name = "Grammar", module = "twinloop._core")]
pub struct PyGrammar(pub Grammar);

#[pymethods]
impl PyGrammar {
    #[new]
    #[pyo3(signature = (
        inputs, outputs, *, spare_registers = 4, pages = 5, page_length = 10,
        operations = vec!["+".into(), "-".into(), "*".into(), "/".into()], writable_inputs = true,
        constant_share = 0.5, constant_low = 1e-3, constant_high = 10.0, constant_step = 0.1,
        mutation_rate = 0.02, aligned_pages = 0.5,
    ))]
    #[expect(clippy::too_many_arguments, reason = "each is a named option of the paper's method")]
    fn new(
        #[pyo3(from_py_with = given)] inputs: usize,
        #[pyo3(from_py_with = given)] outputs: usize,
        #[pyo3(from_py_with = given)] spare_registers: usize,
        #[pyo3(from_py_with = given)] pages: usize,
        #[pyo3(from_py_with = given)] page_length: usize,
        #[pyo3(from_py_with = given)] operations: Vec<String>,
        writable_inputs: bool,
        #[pyo3(from_py_with = given)] constant_share: f64,
        #[pyo3(from_py_with = given)] constant_low: f64,
        #[pyo3(from_py_with = given)] constant_high: f64,
        #[pyo3(from_py_with = given)] constant_step: f64,
        #[pyo3(from_py_with = given)] mutation_rate: f64,
        #[pyo3(from_py_with = given)] aligned_pages: f64,
    ) -> Result<Self> {
        let operations =
            operations.iter().map(|name| name.parse()).collect::<twinloop_core::Result<Vec<Operation>>>()?;
        let grammar = Grammar {
            shape: Shape::new(inputs, outputs, spare_registers)?,
            pages,
            page_length,
            operations,
            writable_inputs,
            constant_share,
            constant_magnitudes: (constant_low, constant_high),
            constant_step,
            mutation_rate,
            aligned_pages,
        };
        Ok(Self(grammar.validated()?))
    }

    #[pyo3(signature = (seed, count = 1))]
    fn random(
        &self,
        #[pyo3(from_py_with = given)] seed: u64,
        #[pyo3(from_py_with = given)] count: usize,
    ) -> Result<Vec<PyProgram>> {
        let most = Variation::MOST_INDIVIDUALS;
        if count > most {
            return Err(misuse(format!("grammar: expected at most {most} programs, found {count}")));
        }
        Ok((0..count).map(|unit| self.0.random(&mut single(seed, unit as u64)).into()).collect())
    }

    fn mutate(&self, program: &PyProgram, #[pyo3(from_py_with = given)] seed: u64) -> Result<PyProgram> {
        self.0.check(&program.0.program)?;
        Ok(self.0.mutate(&program.0.program, &mut single(seed, 0)).into())
    }

    fn crossover(
        &self,
        first: &PyProgram,
        second: &PyProgram,
        #[pyo3(from_py_with = given)] seed: u64,
    ) -> Result<(PyProgram, PyProgram)> {
        self.0.check(&first.0.program)?;
        self.0.check(&second.0.program)?;
        let (first, second) = self.0.crossover(&first.0.program, &second.0.program, &mut single(seed, 0));
        Ok((first.into(), second.into()))
    }
}

/// The stream of a draw that a caller asks for by seed.
fn single(seed: u64, unit: u64) -> Stream {
    Stream::new(seed, Purpose::Single, 0, 0, unit)
}
