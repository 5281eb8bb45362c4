//! The closed-form inverse kinematics of an ortho-parallel arm:
//! `postproc.robot.inverse`.

use std::f64::consts::PI;

use numpy::{PyArray2, PyArray3, PyReadonlyArray1, PyReadonlyArray3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::lines::{poses, Pose};
use crate::rows::{array, blocks, each, flat, same_length, Six};

const WRIST: i64 = 4; // bits of a slot
const SHOULDER: i64 = 2;
const ELBOW: i64 = 1;

/// Lengths of the arm [m], the angle of its bent forearm [rad], and how the formulas'
/// angles become those of its joints.
pub struct Arm {
    a1: f64,
    b: f64,
    c1: f64,
    upper: f64,
    forearm: f64,
    c4: f64,
    bent: f64,
    offset: Six,
    sign: Six,
}

impl Arm {
    /// Take a1, b, c1, upper, forearm, c4, bent, then offsets and signs of the joints.
    pub fn new(p: &[f64]) -> PyResult<Arm> {
        if p.len() != 19 {
            return Err(PyValueError::new_err("an arm has 19 parameters"));
        }
        Ok(Arm {
            a1: p[0],
            b: p[1],
            c1: p[2],
            upper: p[3],
            forearm: p[4],
            c4: p[5],
            bent: p[6],
            offset: std::array::from_fn(|j| p[7 + j]),
            sign: std::array::from_fn(|j| p[13 + j]),
        })
    }

    /// Solve for one branch; NaN where there is none.
    pub fn branch(&self, pose: &Pose, slot: i64) -> Six {
        let angles = self.wrist_up(pose, slot);
        self.to_joints(if slot & WRIST > 0 { flipped(angles) } else { angles })
    }

    /// Solve for all branches.
    fn branches(&self, pose: &Pose) -> [Six; 8] {
        let up: [Six; 4] = std::array::from_fn(|slot| self.wrist_up(pose, slot as i64));
        std::array::from_fn(|slot| {
            let angles = up[slot % 4];
            self.to_joints(if slot >= 4 { flipped(angles) } else { angles })
        })
    }

    /// Name the branch of geometric joint angles.
    pub fn slot(&self, theta: &Six) -> i64 {
        let t: Six = std::array::from_fn(|j| theta[j] * self.sign[j] - self.offset[j]);
        let elbow = t[2] + self.bent;
        let ahead = self.upper * t[1].sin() + self.forearm * (t[1] + elbow).sin();
        WRIST * i64::from(t[4].sin() < 0.0)
            + SHOULDER * i64::from(self.a1 + ahead < 0.0)
            + ELBOW * i64::from(elbow.sin() < 0.0)
    }

    /// Convert the formulas' angles to the arm's geometric ones.
    fn to_joints(&self, angles: Six) -> Six {
        std::array::from_fn(|j| (angles[j] + self.offset[j]) * self.sign[j])
    }

    /// Solve for the shoulder and elbow of a branch, with a positive axis 5.
    fn wrist_up(&self, pose: &Pose, slot: i64) -> Six {
        let axes = [0, 1, 2].map(|k| [pose[k], pose[4 + k], pose[8 + k]]);
        let z_axis = axes[2];
        let cx = pose[3] - self.c4 * z_axis[0];
        let cy = pose[7] - self.c4 * z_axis[1];
        let z = pose[11] - self.c4 * z_axis[2] - self.c1;
        let reach = (cx * cx + cy * cy - self.b * self.b).sqrt();
        let (azimuth, aside) = (cy.atan2(cx), self.b.atan2(reach));
        let behind = slot & SHOULDER > 0;
        let t1 = azimuth + if behind { aside - PI } else { -aside };
        let x = if behind { -reach } else { reach } - self.a1;
        let (lean, fold) = self.triangle(x * x + z * z);
        let side = if slot & ELBOW > 0 { -1.0 } else { 1.0 };
        let t2 = x.atan2(z) - side * lean;
        let t3 = side * fold - self.bent;
        let ((s1, c1), (s23, c23)) = (t1.sin_cos(), (t2 + t3).sin_cos());
        let ahead = axes.map(|a| c1 * a[0] + s1 * a[1]);
        let across = axes.map(|a| c1 * a[1] - s1 * a[0]);
        let up = axes.map(|a| a[2]);
        // The flange's axes out of and along the forearm.
        let out: [f64; 3] = std::array::from_fn(|k| ahead[k] * c23 - up[k] * s23);
        let along = ahead[2] * s23 + up[2] * c23;
        let t4 = across[2].atan2(out[2]);
        let t5 = across[2].hypot(out[2]).atan2(along);
        // Axis 5 seen from the flange; a straight wrist has it too.
        let (s4, c4) = t4.sin_cos();
        let bend = |k: usize| c4 * across[k] - s4 * out[k];
        let angles = [t1, t2, t3, t4, t5, bend(0).atan2(bend(1))];
        if angles.iter().any(|t| t.is_nan()) {
            return [f64::NAN; 6];
        }
        angles
    }

    /// Give the angles of the upper arm against the line to the wrist centre, and
    /// between the arms, for the square of the distance.
    fn triangle(&self, far: f64) -> (f64, f64) {
        let (upper, forearm) = (self.upper, self.forearm);
        let gap = far - forearm * forearm + upper * upper;
        let lean = (gap / (2.0 * far.sqrt() * upper)).acos();
        let fold = (far - upper * upper - forearm * forearm) / (2.0 * upper * forearm);
        (lean, fold.acos())
    }
}

/// Turn the wrist to its other solution.
fn flipped([t1, t2, t3, t4, t5, t6]: Six) -> Six {
    [t1, t2, t3, t4 + PI, -t5, t6 + PI]
}

/// Solve for one branch of every pose (n, 4, 4) [m]: geometric joint angles (n, 6) [rad].
#[pyfunction]
pub fn branch<'py>(
    py: Python<'py>,
    parameters: PyReadonlyArray1<'py, f64>,
    flange: PyReadonlyArray3<'py, f64>,
    slot: PyReadonlyArray1<'py, i64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (arm, poses) = (Arm::new(flat(&parameters)?)?, poses(&flange)?);
    let slot = flat(&slot)?;
    let n = same_length(&[poses.len(), slot.len()])?;
    Ok(array(py, each(py, n, |i| arm.branch(&poses[i], slot[i]))?))
}

/// Solve for all branches of every pose (n, 4, 4) [m]: (n, 8, 6) [rad].
#[pyfunction]
pub fn branches<'py>(
    py: Python<'py>,
    parameters: PyReadonlyArray1<'py, f64>,
    flange: PyReadonlyArray3<'py, f64>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let (arm, poses) = (Arm::new(flat(&parameters)?)?, poses(&flange)?);
    let out = each(py, poses.len(), |i| arm.branches(&poses[i]))?;
    Ok(blocks(py, poses.len(), (8, 6), out.into_flattened().into_flattened()))
}
