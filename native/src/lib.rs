//! The core of postproc: what is done to every row of a long program.
//!
//! Functions take and give whole arrays, let other threads of Python run meanwhile and
//! hear signals (`rows::each`). `tests/reference/` says with numpy what each computes.

use pyo3::prelude::*;

mod aims;
mod aligned;
mod bends;
mod chain;
mod commands;
mod compare;
mod corner;
mod design;
mod deviation;
mod direction;
mod edges;
mod evidence;
mod heap;
mod interned;
mod inverse;
mod lines;
mod logical;
mod model;
mod names;
mod number;
mod numeric;
mod play;
mod pose;
mod pull;
mod rounding;
mod rows;
mod segments;
mod shares;
mod solver;
mod spans;
mod spline;
mod statements;
mod stretches;
mod table;
mod terms;
mod text;
mod time_law;
mod trig;
mod turns;
mod variance;
mod walk;
mod walks;
mod weave;
mod words;
mod zones;

/// Names these sources: a test tells a core that was built from others.
const SOURCES: &str = env!("SOURCES");

#[pymodule(name = "_native")]
fn native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("SOURCES", SOURCES)?;
    module.add("STRAIGHT", deviation::STRAIGHT)?;
    module.add("TOGETHER", spans::TOGETHER)?;
    module.add_class::<model::Core>()?;
    module.add_class::<names::NameColumn>()?;
    module.add_class::<solver::Solver>()?;
    module.add_function(wrap_pyfunction!(chain::placed, module)?)?;
    module.add_function(wrap_pyfunction!(chain::flange, module)?)?;
    module.add_function(wrap_pyfunction!(chain::frames, module)?)?;
    module.add_function(wrap_pyfunction!(chain::jacobian, module)?)?;
    module.add_function(wrap_pyfunction!(chain::landmarks, module)?)?;
    module.add_function(wrap_pyfunction!(chain::torque, module)?)?;
    module.add_function(wrap_pyfunction!(commands::commands, module)?)?;
    module.add_function(wrap_pyfunction!(corner::passed, module)?)?;
    module.add_function(wrap_pyfunction!(rows::use_cores, module)?)?;
    module.add_function(wrap_pyfunction!(rounding::rounded, module)?)?;
    module.add_function(wrap_pyfunction!(zones::zones, module)?)?;
    module.add_function(wrap_pyfunction!(lines::lines, module)?)?;
    module.add_function(wrap_pyfunction!(segments::poses_along, module)?)?;
    module.add_function(wrap_pyfunction!(turns::into_range, module)?)?;
    module.add_function(wrap_pyfunction!(turns::on_turns, module)?)?;
    module.add_function(wrap_pyfunction!(turns::on_other_turns, module)?)?;
    module.add_function(wrap_pyfunction!(inverse::branch, module)?)?;
    module.add_function(wrap_pyfunction!(inverse::branches, module)?)?;
    module.add_function(wrap_pyfunction!(numeric::numeric_branches, module)?)?;
    module.add_function(wrap_pyfunction!(play::reversals, module)?)?;
    module.add_function(wrap_pyfunction!(play::sides_along, module)?)?;
    module.add_function(wrap_pyfunction!(direction::states, module)?)?;
    module.add_function(wrap_pyfunction!(direction::side, module)?)?;
    module.add_function(wrap_pyfunction!(walks::clamps, module)?)?;
    module.add_function(wrap_pyfunction!(walks::refined, module)?)?;
    module.add_function(wrap_pyfunction!(pose::inverse, module)?)?;
    module.add_function(wrap_pyfunction!(pose::pose_from_record, module)?)?;
    module.add_function(wrap_pyfunction!(pose::rotation_vector, module)?)?;
    module.add_function(wrap_pyfunction!(pose::rotations, module)?)?;
    module.add_function(wrap_pyfunction!(pose::times, module)?)?;
    module.add_function(wrap_pyfunction!(terms::turned, module)?)?;
    module.add_function(wrap_pyfunction!(pull::to_move, module)?)?;
    module.add_function(wrap_pyfunction!(deviation::departure, module)?)?;
    module.add_function(wrap_pyfunction!(deviation::departure_along, module)?)?;
    module.add_function(wrap_pyfunction!(shares::stays_within, module)?)?;
    module.add_function(wrap_pyfunction!(design::gram, module)?)?;
    module.add_function(wrap_pyfunction!(design::uncertainty, module)?)?;
    module.add_function(wrap_pyfunction!(evidence::by_groups, module)?)?;
    module.add_function(wrap_pyfunction!(evidence::of_blocks, module)?)?;
    module.add_function(wrap_pyfunction!(evidence::scaled, module)?)?;
    module.add_function(wrap_pyfunction!(heap::give_back, module)?)?;
    module.add_function(wrap_pyfunction!(aims::next_aims, module)?)?;
    module.add_function(wrap_pyfunction!(aligned::aligned, module)?)?;
    module.add_function(wrap_pyfunction!(compare::compare_lines, module)?)?;
    module.add_function(wrap_pyfunction!(table::table, module)?)?;
    module.add_function(wrap_pyfunction!(text::line_starts, module)?)?;
    module.add_function(wrap_pyfunction!(interned::number_in_order, module)?)?;
    module.add_function(wrap_pyfunction!(text::scan_lines, module)?)?;
    module.add_function(wrap_pyfunction!(logical::scan_logical_lines, module)?)?;
    module.add_function(wrap_pyfunction!(statements::scan_statements, module)?)?;
    module.add_function(wrap_pyfunction!(statements::scan_krl, module)?)?;
    module.add_function(wrap_pyfunction!(spline::splines, module)?)?;
    module.add_function(wrap_pyfunction!(stretches::along_stretches, module)?)?;
    module.add_function(wrap_pyfunction!(time_law::fastest, module)?)?;
    module.add_function(wrap_pyfunction!(number::rewrite_numbers, module)?)?;
    module.add_function(wrap_pyfunction!(number::count_decimals, module)?)?;
    module.add_function(wrap_pyfunction!(weave::weave, module)?)?;
    module.add_function(wrap_pyfunction!(weave::is_woven, module)?)?;
    module.add_function(wrap_pyfunction!(weave::cut, module)?)?;
    module.add_function(wrap_pyfunction!(words::holds, module)?)?;
    module.add_function(wrap_pyfunction!(words::lines_beginning, module)?)?;
    Ok(())
}
