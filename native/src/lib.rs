//! Kernels of postproc: what its profile is made of, row by row instead of pass by pass.
//!
//! Every function does what the function of the same name in Python does with numpy, to
//! a few units in the last place; formulas and their sources are documented there.

use pyo3::prelude::*;

mod chain;
mod corner;
mod direction;
mod edges;
mod inverse;
mod lines;
mod play;
mod pose;
mod profile;
mod pull;
mod rounding;
mod rows;
mod trig;
mod variance;
mod walk;
mod walks;

/// Names these sources: the package asks for kernels of its own.
const SOURCES: &str = env!("SOURCES");

#[pymodule]
fn postproc_kernels(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("SOURCES", SOURCES)?;
    module.add_function(wrap_pyfunction!(chain::placed, module)?)?;
    module.add_function(wrap_pyfunction!(chain::flange, module)?)?;
    module.add_function(wrap_pyfunction!(edges::along, module)?)?;
    module.add_function(wrap_pyfunction!(corner::passed, module)?)?;
    module.add_function(wrap_pyfunction!(rounding::resampled, module)?)?;
    module.add_function(wrap_pyfunction!(lines::lines, module)?)?;
    module.add_function(wrap_pyfunction!(lines::chords, module)?)?;
    module.add_function(wrap_pyfunction!(inverse::branch, module)?)?;
    module.add_function(wrap_pyfunction!(inverse::branches, module)?)?;
    module.add_function(wrap_pyfunction!(play::prefix, module)?)?;
    module.add_function(wrap_pyfunction!(direction::states, module)?)?;
    module.add_function(wrap_pyfunction!(direction::side, module)?)?;
    module.add_function(wrap_pyfunction!(walks::clamps, module)?)?;
    module.add_function(wrap_pyfunction!(walks::refined, module)?)?;
    module.add_function(wrap_pyfunction!(pose::inverse, module)?)?;
    module.add_function(wrap_pyfunction!(pose::pose_from_record, module)?)?;
    module.add_function(wrap_pyfunction!(pose::rotation_vector, module)?)?;
    module.add_function(wrap_pyfunction!(pose::times, module)?)?;
    module.add_function(wrap_pyfunction!(profile::profile, module)?)?;
    module.add_function(wrap_pyfunction!(pull::to_move, module)?)?;
    module.add_function(wrap_pyfunction!(variance::variance, module)?)?;
    Ok(())
}
