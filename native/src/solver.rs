//! The inverse kinematics of one arm, from one pose to the next: `postproc.robot.inverse`.

use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::chain::Parameters;
use crate::inverse::Arm;
use crate::lines::{poses, Pose};
use crate::numeric::{wrapped, Numeric, UNSOLVED};
use crate::rows::{array, flat, in_parts, rows, same_length, Six, WORTH};

/// Angles of its form, and back to those of the controller.
struct Mixed {
    arm: Arm,
    mix: [Six; 6],
    unmix: [Six; 6],
}

enum Form {
    Closed(Box<Mixed>),
    Numeric(Box<Numeric>),
}

/// Solves for the joint angles nearest to given ones.
#[pyclass(frozen)]
pub struct Solver(Form);

fn mixed(rows: &[Six; 6], q: &Six) -> Six {
    std::array::from_fn(|i| rows[i].iter().zip(q).map(|(m, q)| m * q).sum())
}

impl Solver {
    /// Name the branch of joint angles; of those that are not known too, see `branch`.
    pub fn slot(&self, q: &Six) -> i64 {
        self.bits(&q.map(|angle| if angle.is_nan() { 0.0 } else { angle }))
    }

    fn bits(&self, q: &Six) -> i64 {
        match &self.0 {
            Form::Closed(form) => form.arm.slot(&mixed(&form.mix, q)),
            Form::Numeric(numeric) => numeric.slot(q) as i64,
        }
    }

    /// Solve for joint angles on a branch, on any turn; NaN where there are none.
    ///
    /// Of a chain without a closed form, all branches of the pose before come and go.
    pub fn on_branch(&self, flange: &Pose, slot: i64, before: &mut [Six; 8]) -> Six {
        let Ok(index) = usize::try_from(slot) else {
            return UNSOLVED;
        };
        match &self.0 {
            Form::Closed(form) => mixed(&form.unmix, &form.arm.branch(flange, slot)),
            Form::Numeric(numeric) => {
                *before = numeric.branches(flange, before);
                before.get(index).copied().unwrap_or(UNSOLVED)
            }
        }
    }

    /// Solve for joint angles on a branch, on the turn nearest to given ones; NaN where
    /// there are none.
    pub fn nearest(&self, flange: &Pose, near: &Six, slot: i64) -> Six {
        match &self.0 {
            Form::Closed(form) => {
                let q = mixed(&form.unmix, &form.arm.branch(flange, slot));
                std::array::from_fn(|j| near[j] + wrapped(q[j] - near[j]))
            }
            Form::Numeric(numeric) => numeric.nearest(flange, near, slot as usize & 7),
        }
    }
}

#[pymethods]
impl Solver {
    /// Solve any chain.
    #[staticmethod]
    fn of_chain(chain: Parameters<'_>) -> PyResult<Solver> {
        Ok(Solver(Form::Numeric(Box::new(Numeric::new(&chain)?))))
    }

    /// Take the parameters of a closed form, and how its angles mix the controller's and
    /// back, (6, 6) each.
    #[staticmethod]
    fn of_closed_form(
        closed: PyReadonlyArray1<'_, f64>,
        mixes: (PyReadonlyArray2<'_, f64>, PyReadonlyArray2<'_, f64>),
    ) -> PyResult<Solver> {
        let square = |m: &PyReadonlyArray2<'_, f64>| -> PyResult<[Six; 6]> {
            let odd = |_| PyValueError::new_err("a mix of six angles has six rows");
            rows::<6>(m)?.to_vec().try_into().map_err(odd)
        };
        let (mix, unmix) = (square(&mixes.0)?, square(&mixes.1)?);
        let arm = Arm::new(flat(&closed)?)?;
        Ok(Solver(Form::Closed(Box::new(Mixed { arm, mix, unmix }))))
    }

    /// Name the branches (slot 4 W + 2 S + E) of joint angles (n, 6) [rad], (n,); of unknown
    /// angles the name has no meaning.
    fn slots<'py>(
        &self,
        py: Python<'py>,
        q: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray1<i64>>> {
        let q = rows::<6>(&q)?;
        let one = |i: usize| self.bits(&q[i]);
        Ok(in_parts(py, q.len(), WORTH, |some| some.map(one).collect())?.into_pyarray(py))
    }

    /// Solve flange poses (n, 4, 4) [m] on branches (n,) next to joint angles (n, 6):
    /// (n, 6) [rad], NaN where there is no solution.
    #[pyo3(name = "nearest")]
    fn nearest_rows<'py>(
        &self,
        py: Python<'py>,
        flange: PyReadonlyArray3<'py, f64>,
        near: PyReadonlyArray2<'py, f64>,
        slot: PyReadonlyArray1<'py, i64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (flange, near, slot) = (poses(&flange)?, rows::<6>(&near)?, flat(&slot)?);
        let n = same_length(&[flange.len(), near.len(), slot.len()])?;
        let one = |i: usize| self.nearest(&flange[i], &near[i], slot[i]);
        Ok(array(py, in_parts(py, n, WORTH, |some| some.map(one).collect())?))
    }
}
