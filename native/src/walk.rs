//! Axes and points met along a chain with deviations: `postproc.model.kinematics.walk`.

use crate::chain::Chain;
use crate::rows::{minus, Six, Three};

/// Where the chain begins.
pub struct Base {
    /// Axes x, y, z.
    pub axes: [Three; 3],
    /// Axes of its three rotations.
    pub about: [Three; 3],
    pub point: Three,
}

/// Axes and points of one pose, as in the Python class.
#[derive(Default)]
pub struct Walk {
    pub turn: [Three; 6],
    pub pivot: [Three; 6],
    pub link: [Three; 6],
    pub corner: [Three; 6],
    pub bend: [Three; 6],
    /// Axes x, y, z.
    pub flange: [Three; 3],
    pub tcp: Three,
}

pub fn cross(a: &Three, b: &Three) -> Three {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Turn the orthogonal axes a towards b.
fn turned(a: Three, b: Three, (sin, cos): (f64, f64)) -> (Three, Three) {
    let first = std::array::from_fn(|k| cos * a[k] + sin * b[k]);
    (first, std::array::from_fn(|k| cos * b[k] - sin * a[k]))
}

impl Walk {
    /// Walk from the base to the tool centre point.
    pub fn new(chain: &Chain, base: &Base, q: &Six, tool: &Three) -> Walk {
        let mut walk = Walk::default();
        let ([mut x, mut y, mut z], mut p) = (base.axes, base.point);
        let (sin, cos) = chain.sin_cos(q);
        for (i, link) in chain.0.iter().enumerate() {
            (walk.turn[i], walk.pivot[i]) = (z, p);
            (x, y) = turned(x, y, (sin[i], cos[i]));
            p = std::array::from_fn(|k| p[k] + link.d * z[k] + link.a * x[k]);
            (y, z) = turned(y, z, link.alpha);
            (walk.link[i], walk.corner[i], walk.bend[i]) = (x, p, y);
            if let Some(beta) = link.beta {
                (z, x) = turned(z, x, beta);
            }
        }
        let [tx, ty, tz] = *tool;
        walk.tcp = std::array::from_fn(|k| p[k] + (x[k] * tx + y[k] * ty + z[k] * tz));
        walk.flange = [x, y, z];
        walk
    }

    /// Velocity of the TCP when the body turns about an axis through a point.
    pub fn swept(&self, axis: &Three, point: &Three) -> Three {
        cross(axis, &minus(&self.tcp, point))
    }

    /// Derivative of the TCP by the controller's joint angles [m/rad].
    pub fn jacobian(&self, chain: &Chain) -> [Three; 6] {
        chain.to_controller(&std::array::from_fn(|i| self.swept(&self.turn[i], &self.pivot[i])))
    }
}
