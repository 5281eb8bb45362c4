//! Names of a program, a million of them without an object each:
//! `postproc.language.symbol_column`.

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::{PyList, PyString, PyTuple};

use crate::interned::Interned;
use crate::rows::{detached, each, flat};
use crate::text::latin_1;

/// Names that are taken from Python between two looks at signals.
const AT_ONCE: usize = 1 << 16;

type Column<'py> = Bound<'py, PyArray1<i32>>;

/// Names one behind the other, as UTF-8. They are found by a table that is made when it is
/// asked for first.
#[pyclass(sequence, module = "postproc._native")]
#[derive(Default)]
pub struct NameColumn(Interned);

impl NameColumn {
    /// Take distinct texts in Latin-1 over.
    pub fn of_latin_1(mut texts: Interned) -> Self {
        texts.settle();
        if texts.bytes().is_ascii() {
            return NameColumn(texts);
        }
        let mut own = NameColumn::default();
        texts.texts().for_each(|text| own.0.push(latin_1(text).as_bytes()));
        own
    }

    fn text(&self, number: usize) -> &str {
        std::str::from_utf8(self.0.text(number)).expect("names are UTF-8")
    }

    /// Make the table where there is none.
    fn make_table(&mut self, py: Python<'_>) -> PyResult<()> {
        let texts = self.0.begin_table();
        let made = each(py, texts, |number| self.0.enter(number)).map(|_| ());
        if made.is_err() {
            self.0.forget_table(); // not all are in it
        }
        made
    }

    fn listed<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        PyList::new(py, (0..self.0.len()).map(|k| self.text(k)))
    }

    /// Do something with every given name, in order.
    fn for_all<T: Send>(
        given: &Bound<'_, PyAny>,
        mut work: impl FnMut(&[u8]) -> T + Send,
    ) -> PyResult<Vec<T>> {
        let py = given.py();
        if let Ok(column) = given.cast::<NameColumn>() {
            let column = column.try_borrow()?;
            let names = &column.0;
            return each(py, names.len(), |i| work(names.text(i)));
        }
        let mut out = Vec::new();
        for (i, name) in given.try_iter()?.enumerate() {
            if i % AT_ONCE == 0 {
                py.check_signals()?;
            }
            out.push(work(name?.cast::<PyString>()?.to_str()?.as_bytes()));
        }
        Ok(out)
    }
}

#[pymethods]
impl NameColumn {
    #[new]
    #[pyo3(signature = (names=None))]
    fn new(names: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let mut own = NameColumn::default();
        if let Some(names) = names {
            own.extend(names)?;
        }
        Ok(own)
    }

    /// Put names behind the own ones, be they among them or not.
    fn extend(&mut self, names: &Bound<'_, PyAny>) -> PyResult<()> {
        self.0.forget_table();
        NameColumn::for_all(names, |name| self.0.push(name)).map(|_| ())
    }

    /// Put names behind the own ones that are not among them; return their numbers, (m,).
    fn of<'py>(&mut self, names: &Bound<'py, PyAny>) -> PyResult<Column<'py>> {
        Ok(NameColumn::for_all(names, |name| self.0.of(name))?.into_pyarray(names.py()))
    }

    /// Find names among the own ones: the first number of each, (m,), -1 where it is not.
    fn find<'py>(&mut self, names: &Bound<'py, PyAny>) -> PyResult<Column<'py>> {
        self.make_table(names.py())?;
        Ok(NameColumn::for_all(names, |name| self.0.find(name))?.into_pyarray(names.py()))
    }

    /// Return the first number of a name, -1 where it is not among the own ones.
    fn number(&mut self, py: Python<'_>, name: &str) -> PyResult<i32> {
        self.make_table(py)?;
        Ok(self.0.find(name.as_bytes()))
    }

    /// Return the names of some numbers, (m,).
    fn take(&self, py: Python<'_>, numbers: PyReadonlyArray1<'_, i64>) -> PyResult<Self> {
        let (numbers, mut own) = (flat(&numbers)?, NameColumn::default());
        if numbers.iter().any(|k| *k < 0 || *k >= self.0.len() as i64) {
            return Err(PyIndexError::new_err("a name that is not there"));
        }
        each(py, numbers.len(), |i| own.0.push(self.0.text(numbers[i] as usize)))?;
        own.0.settle();
        Ok(own)
    }

    /// Return the names in small letters.
    fn lower(&self, py: Python<'_>) -> PyResult<Self> {
        let mut own = NameColumn::default();
        each(py, self.0.len(), |i| match self.0.text(i).is_ascii() {
            true => own.0.push(&self.0.text(i).to_ascii_lowercase()),
            false => own.0.push(self.text(i).to_lowercase().as_bytes()),
        })?;
        own.0.settle();
        Ok(own)
    }

    /// Tell whether any name holds one of some letters of ASCII.
    fn hold(&self, py: Python<'_>, letters: &str) -> PyResult<bool> {
        detached(py, || self.0.bytes().iter().any(|b| letters.as_bytes().contains(b)))
    }

    /// Let go of the table that finds names, and of room for more.
    fn settle(&mut self) {
        self.0.settle();
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }

    fn __getitem__<'py>(&self, py: Python<'py>, number: isize) -> PyResult<Bound<'py, PyString>> {
        match usize::try_from(number) {
            Ok(number) if number < self.0.len() => Ok(PyString::new(py, self.text(number))),
            _ => Err(PyIndexError::new_err("a name that is not there")),
        }
    }

    fn __contains__(&mut self, name: &Bound<'_, PyAny>) -> PyResult<bool> {
        match name.cast::<PyString>() {
            Ok(text) => Ok(self.number(name.py(), text.to_str()?)? >= 0),
            Err(_) => Ok(false),
        }
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> PyResult<bool> {
        if let Ok(other) = other.cast::<NameColumn>() {
            return Ok(other.try_borrow().is_ok_and(|other| self.0.same(&other.0)));
        }
        match other.cast::<PyTuple>() {
            Ok(names) => Ok(self.0.same(&NameColumn::new(Some(names.as_any()))?.0)),
            Err(_) => Ok(false),
        }
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        Ok(format!("NameColumn({})", self.listed(py)?.repr()?))
    }

    fn __reduce__<'py>(
        own: &Bound<'py, Self>,
    ) -> PyResult<(Bound<'py, PyAny>, (Bound<'py, PyList>,))> {
        Ok((own.get_type().into_any(), (own.try_borrow()?.listed(own.py())?,)))
    }
}
