//! Sums over the rows of a design matrix: `postproc.calibration.design_matrix`.
//!
//! The column of what turns a joint is the joint's column of the Jacobian by a number, and
//! of the splines of a joint four differ from 0 at a row: sums over rows touch a hundred of
//! a thousand columns. Features are the columns that move the position, then what turns
//! joints, then splines; columns are mixes of features, which are summed once.

use numpy::ndarray::Array2;
use numpy::{IntoPyArray, PyArray2, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::rows::{array, each, flat, groups, same_length, Three};

/// Splines of one joint that differ from 0 at a row.
const LOCAL: usize = 4;

/// Jacobian (n, 3, 6) and the columns that move the position (n, 3, m).
type Moving<'py> = (PyReadonlyArray3<'py, f64>, PyReadonlyArray3<'py, f64>);
/// By how much d columns turn a joint, (n, d), and which.
type Turning<'py> = (PyReadonlyArray2<'py, f64>, Vec<usize>);
/// The first spline of each of s sets, (n, s), their values, (n, 4 s), the joints of the
/// sets, and how many splines there are.
type Splines<'py> = (PyReadonlyArray2<'py, i64>, PyReadonlyArray2<'py, f64>, Vec<usize>, usize);
type Sums<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>);

/// The features of all rows.
struct Features<'a> {
    jacobian: &'a [[f64; 18]],
    direct: &'a [f64],
    angles: &'a [f64],
    turned: &'a [usize],
    first: &'a [i64],
    weight: &'a [[f64; LOCAL]],
    sets: &'a [usize],
    moving: usize,
    splines: usize,
}

impl<'a> Features<'a> {
    fn new(
        moving: &'a Moving<'_>,
        turning: &'a Turning<'_>,
        splines: &'a Splines<'_>,
    ) -> PyResult<Self> {
        let (turned, sets) = (&turning.1[..], &splines.2[..]);
        let shapes = (moving.0.shape(), moving.1.shape(), turning.0.shape(), splines.0.shape());
        let n = same_length(&[shapes.0[0], shapes.1[0], shapes.2[0], shapes.3[0]])?;
        let features = Self {
            jacobian: groups(flat(&moving.0)?),
            direct: flat(&moving.1)?,
            angles: flat(&turning.0)?,
            turned,
            first: flat(&splines.0)?,
            weight: groups(flat(&splines.1)?),
            sets,
            moving: shapes.1[2],
            splines: splines.3,
        };
        let fits = shapes.0[1..] == [3, 6]
            && shapes.1[1] == 3
            && features.angles.len() == n * turned.len()
            && features.weight.len() == n * sets.len()
            && features.first.len() == n * sets.len()
            && turned.iter().chain(sets).all(|joint| *joint < 6)
            && features.first.iter().all(|k| *k >= 0 && *k as usize + LOCAL <= splines.3);
        match fits {
            true => Ok(features),
            false => Err(PyValueError::new_err("features of other rows, joints or splines")),
        }
    }

    fn len(&self) -> usize {
        self.jacobian.len()
    }

    /// How many features are no splines.
    fn plain(&self) -> usize {
        self.moving + self.turned.len()
    }

    fn row(&self, n: usize) -> Row<'_> {
        let (m, d, s) = (self.moving, self.turned.len(), self.sets.len());
        let jacobian = &self.jacobian[n];
        Row {
            axes: std::array::from_fn(|j| [jacobian[j], jacobian[6 + j], jacobian[12 + j]]),
            direct: std::array::from_fn(|k| &self.direct[(3 * n + k) * m..][..m]),
            angles: &self.angles[n * d..][..d],
            first: &self.first[n * s..][..s],
            weight: &self.weight[n * s..][..s],
        }
    }
}

/// The features of one row.
struct Row<'a> {
    /// What turning each joint moves.
    axes: [Three; 6],
    direct: [&'a [f64]; 3],
    angles: &'a [f64],
    first: &'a [i64],
    weight: &'a [[f64; LOCAL]],
}

impl Row<'_> {
    /// Products of what turning the joints moves.
    fn products(&self) -> [[f64; 6]; 6] {
        let dot = |a: &Three, b: &Three| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        self.axes.map(|a| std::array::from_fn(|j| dot(&a, &self.axes[j])))
    }

    /// Sets of splines: the joint, the first that is not 0, and their values.
    fn sets<'b>(
        &'b self,
        of: &'b Features<'_>,
    ) -> impl Iterator<Item = (usize, usize, &'b [f64; LOCAL])> {
        (of.sets.iter().zip(self.first).zip(self.weight)).map(|((j, k), w)| (*j, *k as usize, w))
    }
}

#[inline(always)]
fn add(sum: &mut [f64], factor: f64, of: &[f64]) {
    for (sum, x) in sum.iter_mut().zip(of) {
        *sum += factor * x;
    }
}

#[inline(always)]
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a_eights, b_eights) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = a_eights.remainder().iter().zip(b_eights.remainder()).map(|(x, y)| x * y).sum();
    for (x, y) in a_eights.zip(b_eights) {
        for k in 0..8 {
            sums[k] += x[k] * y[k];
        }
    }
    rest + sums.iter().sum::<f64>()
}

/// Sums of products of features.
struct Gram {
    /// Of all features with those that are no splines: their lower half.
    plain: Vec<f64>,
    /// Of splines, of a set with itself and with those before it.
    splines: Vec<f64>,
    /// Products of the row's features that are no splines with what each joint moves.
    along: [Vec<f64>; 6],
}

impl Gram {
    fn new(of: &Features<'_>) -> Self {
        let (plain, splines) = (of.plain(), of.splines);
        Self {
            plain: vec![0.0; (plain + splines) * plain],
            splines: vec![0.0; splines * splines],
            along: std::array::from_fn(|_| vec![0.0; plain]),
        }
    }

    #[inline(always)]
    fn add(&mut self, of: &Features<'_>, n: usize) {
        let (row, m, width) = (of.row(n), of.moving, of.plain());
        let products = row.products();
        for (j, along) in self.along.iter_mut().enumerate() {
            let (own, turned) = along.split_at_mut(m);
            own.fill(0.0);
            for k in 0..3 {
                add(own, row.axes[j][k], row.direct[k]);
            }
            for ((out, angle), a) in turned.iter_mut().zip(row.angles).zip(of.turned) {
                *out = products[j][*a] * angle;
            }
        }
        for i in 0..m {
            for k in 0..3 {
                let direct = row.direct[k];
                add(&mut self.plain[i * width..][..=i], direct[i], &direct[..=i]);
            }
        }
        for (k, (angle, j)) in row.angles.iter().zip(of.turned).enumerate() {
            let at = m + k;
            add(&mut self.plain[at * width..][..=at], *angle, &self.along[*j][..=at]);
        }
        self.add_splines(of, &row, &products);
    }

    #[inline(always)]
    fn add_splines(&mut self, of: &Features<'_>, row: &Row<'_>, products: &[[f64; 6]; 6]) {
        let (width, count) = (of.plain(), of.splines);
        for (number, (j, first, weight)) in row.sets(of).enumerate() {
            let rows = &mut self.plain[(width + first) * width..][..LOCAL * width];
            for (k, w) in weight.iter().enumerate() {
                add(&mut rows[k * width..][..width], *w, &self.along[j]);
            }
            for (a, before, others) in row.sets(of).take(number + 1) {
                let both = others.map(|x| x * products[j][a]);
                for (k, w) in weight.iter().enumerate() {
                    let sums = &mut self.splines[(first + k) * count + before..][..LOCAL];
                    add(sums, *w, &both);
                }
            }
        }
    }
}

/// A quadratic form of the features.
struct Form<'a> {
    /// Of all features with those that are no splines; what is off the diagonal is not
    /// seen above it and counts twice.
    plain: &'a [f64],
    splines: &'a [f64],
    /// By joint, the form with the row's features that turn it.
    with: [Vec<f64>; 6],
    own: Vec<f64>,
}

impl Form<'_> {
    #[inline(always)]
    fn value(&mut self, of: &Features<'_>, n: usize) -> Three {
        let (row, m, width) = (of.row(n), of.moving, of.plain());
        let among = self.among(of, &row);
        let mut total: Three = std::array::from_fn(|k| {
            let axes: [f64; 6] = std::array::from_fn(|j| row.axes[j][k]);
            (0..6).map(|a| axes[a] * dot(&among[a], &axes)).sum()
        });
        for (k, (total, direct)) in total.iter_mut().zip(row.direct).enumerate() {
            self.own[..m].fill(0.0);
            for (i, x) in direct.iter().enumerate() {
                add(&mut self.own[..=i], *x, &self.plain[i * width..][..=i]);
            }
            for (axis, with) in row.axes.iter().zip(&self.with) {
                add(&mut self.own[..m], axis[k], &with[..m]);
            }
            *total += dot(&self.own[..m], direct);
        }
        total
    }

    /// The form among what turns joints, (6, 6).
    #[inline(always)]
    fn among(&mut self, of: &Features<'_>, row: &Row<'_>) -> [[f64; 6]; 6] {
        let (m, width, count) = (of.moving, of.plain(), of.splines);
        let mut among = [[0.0; 6]; 6];
        self.with.iter_mut().for_each(|with| with.fill(0.0));
        for (k, (angle, j)) in row.angles.iter().zip(of.turned).enumerate() {
            let at = m + k;
            add(&mut self.with[*j][..=at], *angle, &self.plain[at * width..][..=at]);
        }
        for (number, (j, first, weight)) in row.sets(of).enumerate() {
            let rows = &self.plain[(width + first) * width..][..LOCAL * width];
            for (k, w) in weight.iter().enumerate() {
                add(&mut self.with[j], *w, &rows[k * width..][..width]);
            }
            for (b, (a, before, others)) in row.sets(of).take(number + 1).enumerate() {
                let mut sum = 0.0;
                for (k, w) in weight.iter().enumerate() {
                    let with = &self.splines[(first + k) * count + before..][..LOCAL];
                    sum += w
                        * (with[0] * others[0]
                            + with[1] * others[1]
                            + with[2] * others[2]
                            + with[3] * others[3]);
                }
                among[j][a] += if b == number { sum } else { 2.0 * sum };
            }
        }
        for (a, with) in self.with.iter().enumerate() {
            for ((w, angle), b) in with[m..].iter().zip(row.angles).zip(of.turned) {
                among[a][*b] += w * angle;
            }
        }
        among
    }
}

/// The same with registers for four numbers.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
unsafe fn sum_wide(sums: &mut Gram, of: &Features<'_>, n: usize) {
    sums.add(of, n);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
unsafe fn value_wide(form: &mut Form<'_>, of: &Features<'_>, n: usize) -> Three {
    form.value(of, n)
}

/// Choose what this machine can do; the numbers are the same.
fn summed(sums: &mut Gram, of: &Features<'_>, n: usize) {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        // SAFETY: this machine has what the function is compiled for.
        return unsafe { sum_wide(sums, of, n) };
    }
    sums.add(of, n);
}

fn valued(form: &mut Form<'_>, of: &Features<'_>, n: usize) -> Three {
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") {
        // SAFETY: as above.
        return unsafe { value_wide(form, of, n) };
    }
    form.value(of, n)
}

/// Sum products of features over all rows, (m + d + s, m + d) and (s, s).
///
/// Of the first, the upper half of what are no splines stays 0; of the second, what stands
/// right of the splines of one set.
#[pyfunction]
pub fn gram<'py>(
    py: Python<'py>,
    moving: Moving<'py>,
    turning: Turning<'py>,
    splines: Splines<'py>,
) -> PyResult<Sums<'py>> {
    let of = Features::new(&moving, &turning, &splines)?;
    let mut sums = Gram::new(&of);
    each(py, of.len(), |n| summed(&mut sums, &of, n))?;
    let square = |values: Vec<f64>, width: usize, rows: usize| {
        Array2::from_shape_vec((rows, width), values).expect("as many sums").into_pyarray(py)
    };
    let (width, count) = (of.plain(), of.splines);
    Ok((square(sums.plain, width, width + count), square(sums.splines, count, count)))
}

/// Variance of every component, (n, 3), from a quadratic form of the features.
///
/// Form: as `gram` returns its sums, with what is below the diagonal of the first twice.
#[pyfunction]
pub fn uncertainty<'py>(
    py: Python<'py>,
    moving: Moving<'py>,
    turning: Turning<'py>,
    splines: Splines<'py>,
    form: (PyReadonlyArray2<'py, f64>, PyReadonlyArray2<'py, f64>),
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let of = Features::new(&moving, &turning, &splines)?;
    let (width, count) = (of.plain(), of.splines);
    if form.0.shape() != [width + count, width] || form.1.shape() != [count, count] {
        return Err(PyValueError::new_err("a form of other features"));
    }
    let (with, own) = (std::array::from_fn(|_| vec![0.0; width]), vec![0.0; width]);
    let mut form = Form { plain: flat(&form.0)?, splines: flat(&form.1)?, with, own };
    let out = each(py, of.len(), |n| valued(&mut form, &of, n))?;
    Ok(array(py, out))
}
