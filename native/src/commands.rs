//! Commands that land where they should: `postproc.compensation.solver.inverse_model`.

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyReadonlyArray3};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::lines::{poses, Pose};
use crate::model::{Core, Rows, States};
use crate::pose::{inverted, product, rotation_from_vector};
use crate::rows::{array, blocks, dot, in_parts, minus, Six, Three, WORTH};
use crate::solver::Solver;
use crate::terms::State;

const CLOSE: f64 = 2e-7; // [m] where iterating stops
const CLOSE_TURN: f64 = 2e-7; // [rad] likewise
const MOST: usize = 5; // iterations

/// A command of one target.
struct Command {
    q: Six,
    pose: Pose,
    residual: f64,
}

fn place(pose: &Pose) -> Three {
    [pose[3], pose[7], pose[11]]
}

fn size(v: &Three) -> f64 {
    dot(v, v).sqrt()
}

/// What it takes to solve for commands.
struct Search<'a> {
    core: &'a Core,
    solver: &'a Solver,
    turns: bool,
}

impl Search<'_> {
    /// Move a command until it is predicted to land where it should.
    ///
    /// The branch stays, and so does the orientation unless it is corrected too.
    fn command(&self, wanted: &Pose, tool: &Pose, s: &Rows<'_>, i: usize) -> Command {
        let (goal, from_tcp) = (place(wanted), inverted(tool));
        let (mut q, mut pose) = (s.q[i], *wanted);
        let slot = self.solver.slot(&q);
        let (error, mut turned) = self.predict(&q, s, i);
        let mut landing: Three = std::array::from_fn(|k| goal[k] + error[k]);
        let mut allowed = [0.0; 3];
        for _ in 0..MOST {
            let far = size(&minus(&landing, &goal)) > CLOSE; // NaN is not far
            if !(far || self.turns && size(&minus(&turned, &allowed)) > CLOSE_TURN) {
                break;
            }
            for k in 0..3 {
                pose[4 * k + 3] += goal[k] - landing[k];
            }
            if self.turns {
                turn_back(&mut pose, wanted, &turned);
                allowed = turned;
            }
            q = self.solver.nearest(&product(&pose, &from_tcp), &q, slot);
            let (error, now) = self.predict(&q, s, i);
            landing = std::array::from_fn(|k| pose[4 * k + 3] + error[k]);
            turned = now;
        }
        Command { q, pose, residual: size(&minus(&landing, &goal)) }
    }

    /// Predict the error of joint angles, and the tool's turn where it counts.
    fn predict(&self, q: &Six, s: &Rows<'_>, i: usize) -> (Three, Three) {
        let (tool, given) = (s.tool(i), s.given(i));
        self.core.with_state((q, &s.side[i]), s.load(i), given, |state: &State<'_>| {
            let turn = if self.turns { self.core.turn(state, tool) } else { [0.0; 3] };
            (self.core.error(state, tool), turn)
        })
    }
}

/// Turn a command's axes against a turn.
fn turn_back(pose: &mut Pose, wanted: &Pose, turned: &Three) {
    let back = rotation_from_vector(turned.map(|angle| -angle));
    for i in 0..3 {
        for j in 0..3 {
            pose[4 * i + j] = (0..3).map(|k| back[3 * i + k] * wanted[4 * k + j]).sum();
        }
    }
}

type Columns<'py> =
    (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray3<f64>>, Bound<'py, PyArray1<f64>>);

/// Find the commands whose predicted landing is the wanted place.
///
/// Args: the model and the arm's inverse kinematics; wanted TCP poses (n, 4, 4) [m]; tools
/// in the flange frame, likewise or (1, 4, 4); nominal states; whether to correct the
/// orientation too.
///
/// Returns: joint angles (n, 6) [rad], NaN where the command cannot be reached, TCP poses
/// to command (n, 4, 4), distances of the predicted landings (n,) [m].
#[pyfunction]
pub fn commands<'py>(
    py: Python<'py>,
    core: &Core,
    solver: &Solver,
    wanted: PyReadonlyArray3<'py, f64>,
    tool: PyReadonlyArray3<'py, f64>,
    states: States<'py>,
    turns: bool,
) -> PyResult<Columns<'py>> {
    let (wanted, tools, s) = (poses(&wanted)?, poses(&tool)?, states.rows(core)?);
    let n = s.len();
    if wanted.len() != n || (tools.len() != 1 && tools.len() != n) {
        return Err(PyValueError::new_err("commands of other lengths"));
    }
    let search = Search { core, solver, turns };
    let tool = |i: usize| if tools.len() == 1 { &tools[0] } else { &tools[i] };
    let one = |i: usize| search.command(&wanted[i], tool(i), &s, i);
    let found = in_parts(py, n, WORTH, |some| some.map(one).collect())?;
    let (mut q, mut pose, mut residual) =
        (Vec::with_capacity(n), Vec::with_capacity(n), Vec::with_capacity(n));
    for command in found {
        q.push(command.q);
        pose.push(command.pose);
        residual.push(command.residual);
    }
    let pose = blocks(py, n, (4, 4), pose.into_flattened());
    Ok((array(py, q), pose, residual.into_pyarray(py)))
}
