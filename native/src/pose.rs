//! Rigid transforms, pose by pose: `postproc.robot.pose`.

use numpy::PyUntypedArrayMethods;
use numpy::{PyArray2, PyArray3, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::lines::{self, poses, Pose, Rotation};
use crate::rows::{array, blocks, each, flat, groups, rows, same_length, Six, Three};
use crate::trig::sin_cos;

const MM: f64 = 1e-3;
const SMALL: f64 = 1e-3; // [rad] below which a series stands for a quotient

fn to_python(py: Python<'_>, poses: Vec<Pose>) -> Bound<'_, PyArray3<f64>> {
    blocks(py, poses.len(), (4, 4), poses.into_flattened())
}

pub fn inverted(t: &Pose) -> Pose {
    let mut out = [0.0; 16];
    for i in 0..3 {
        let (x, y, z) = (t[i], t[4 + i], t[8 + i]);
        let shift = -(x * t[3] + y * t[7] + z * t[11]);
        out[4 * i..4 * i + 4].copy_from_slice(&[x, y, z, shift]);
    }
    out[15] = 1.0;
    out
}

fn from_record(record: &Six) -> Pose {
    let [a, e, r] = [record[3], record[4], record[5]].map(f64::to_radians);
    let ([sa, se, sr, ..], [ca, ce, cr, ..]) = sin_cos(&[a, e, r, 0.0, 0.0, 0.0]);
    let [x, y, z] = [record[0], record[1], record[2]].map(|mm| mm * MM);
    [
        ca * ce * cr - sa * sr,
        -ca * ce * sr - sa * cr,
        ca * se,
        x,
        sa * ce * cr + ca * sr,
        -sa * ce * sr + ca * cr,
        sa * se,
        y,
        -se * cr,
        se * sr,
        ce,
        z,
        0.0,
        0.0,
        0.0,
        1.0,
    ]
}

/// The rotation about a vector [rad], by rows.
pub fn rotation_from_vector([x, y, z]: Three) -> [f64; 9] {
    let angle = (x * x + y * y + z * z).sqrt();
    let ([sin], [w]) = sin_cos(&[angle / 2.0]);
    let square = angle * angle;
    let scale =
        if angle <= SMALL { 0.5 - square / 48.0 + square * square / 3840.0 } else { sin / angle };
    let (x, y, z) = (scale * x, scale * y, scale * z);
    let (xx, yy, zz, ww) = (x * x, y * y, z * z, w * w);
    [
        xx - yy - zz + ww,
        2.0 * (x * y - z * w),
        2.0 * (x * z + y * w),
        2.0 * (x * y + z * w),
        -xx + yy - zz + ww,
        2.0 * (y * z - x * w),
        2.0 * (x * z - y * w),
        2.0 * (y * z + x * w),
        -xx - yy + zz + ww,
    ]
}

pub fn product(a: &Pose, b: &Pose) -> Pose {
    std::array::from_fn(|at| {
        let (i, j) = (at / 4 * 4, at % 4);
        a[i] * b[j] + a[i + 1] * b[4 + j] + a[i + 2] * b[8 + j] + a[i + 3] * b[12 + j]
    })
}

/// Invert poses, (n, 4, 4).
#[pyfunction]
pub fn inverse<'py>(
    py: Python<'py>,
    given: PyReadonlyArray3<'py, f64>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let poses = poses(&given)?;
    Ok(to_python(py, each(py, poses.len(), |i| inverted(&poses[i]))?))
}

/// Convert position records (n, 6) [mm, deg] to poses, (n, 4, 4) [m].
#[pyfunction]
pub fn pose_from_record<'py>(
    py: Python<'py>,
    record: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let records = rows::<6>(&record)?;
    Ok(to_python(py, each(py, records.len(), |i| from_record(&records[i]))?))
}

/// Multiply poses with others, (n, 4, 4).
#[pyfunction]
pub fn times<'py>(
    py: Python<'py>,
    left: PyReadonlyArray3<'py, f64>,
    right: PyReadonlyArray3<'py, f64>,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let (left, right) = (poses(&left)?, poses(&right)?);
    let n = same_length(&[left.len(), right.len()])?;
    Ok(to_python(py, each(py, n, |i| product(&left[i], &right[i]))?))
}

/// Return the rotation vectors of rotations (n, 3, 3), (n, 3) [rad].
#[pyfunction]
pub fn rotation_vector<'py>(
    py: Python<'py>,
    given: PyReadonlyArray3<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    if given.shape()[1..] != [3, 3] {
        return Err(PyValueError::new_err("rotations are (n, 3, 3)"));
    }
    let rotations: &[Rotation] = groups(groups(flat(&given)?));
    Ok(array(py, each(py, rotations.len(), |i| lines::rotation_vector(&rotations[i]))?))
}

/// Return the rotations (n, 9), by rows, about vectors (n, 3) [rad].
#[pyfunction]
#[pyo3(name = "rotation_from_vector")]
pub fn rotations<'py>(
    py: Python<'py>,
    vectors: PyReadonlyArray2<'py, f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let vectors = rows::<3>(&vectors)?;
    Ok(array(py, each(py, vectors.len(), |i| rotation_from_vector(vectors[i]))?))
}
