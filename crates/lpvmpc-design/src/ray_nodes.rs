//! How many nodes the embedding along the ray from a steady state needs.

use crate::embedding_check::{EmbeddingCheckError, EmbeddingDefect, embedding_defect};
use lpvmpc::{AlongRay, Bounds, Dynamics, GaussLegendre, LpvModel};
use nalgebra::{SMatrix, SVector};

/// A formula for [`AlongRay`] and what it achieves.
#[derive(Debug, Clone, PartialEq)]
pub struct RayNodes<const NX: usize, const NU: usize> {
    /// The formula.
    pub nodes: GaussLegendre,
    /// Where f(x_r, u_r) + A (x - x_r) + B (u - u_r) differs most from f(x, u): what the affine term of
    /// [`AlongRay`] has to make up for.
    pub defect: EmbeddingDefect<NX, NU>,
}

/// The least number of nodes with which the embedding of `plant` along the rays from the point `at`
/// (x_r, u_r) is f, up to `tolerance` of the largest |f| of each component over the box of `x` and `u`:
/// with [`GaussLegendre::MOST`] nodes, where no smaller number is enough, the defect may be larger than
/// that.
///
/// The box is looked at as [`embedding_defect`] does, at `points` points, and from the worst of them
/// uphill.
///
/// # Errors
/// The box is not finite, or f or its derivatives are not finite at one of its points.
///
/// # Example
///
/// ```
/// use lpvmpc::{AlongRay, Bounds, Dynamics, Number};
/// use lpvmpc_design::nodes_along_ray;
/// use nalgebra::{Vector1, Vector2};
///
/// struct Pendulum;
/// impl Dynamics<2, 1> for Pendulum {
///     fn f<N: Number>(&self, x: &Vector2<N>, u: &Vector1<N>) -> Vector2<N> {
///         Vector2::new(x[1], N::constant(9.81) * x[0].sin() + u[0])
///     }
/// }
/// let upright = (&Vector2::zeros(), &Vector1::zeros());
/// let x = Bounds { lower: Vector2::new(-1.0, -3.0), upper: Vector2::new(1.0, 3.0) };
/// let u = Bounds { lower: Vector1::new(-8.0), upper: Vector1::new(8.0) };
/// let found = nodes_along_ray::<_, 2, 1, 3>(&Pendulum, upright, (&x, &u), 1e-4, 200)?;
/// assert_eq!(found.nodes.count(), 3);
/// assert!(found.defect.relative < 1e-4);
/// let model = AlongRay::<_, f64, 2, 1, 3> {
///     plant: Pendulum,
///     x: Vector2::zeros(),
///     u: Vector1::zeros(),
///     nodes: found.nodes,
/// };
/// # let _ = model;
/// # Ok::<(), lpvmpc_design::EmbeddingCheckError>(())
/// ```
pub fn nodes_along_ray<P, const NX: usize, const NU: usize, const NS: usize>(
    plant: &P,
    at: (&SVector<f64, NX>, &SVector<f64, NU>),
    (x, u): (&Bounds<f64, NX>, &Bounds<f64, NU>),
    tolerance: f64,
    points: usize,
) -> Result<RayNodes<NX, NU>, EmbeddingCheckError>
where
    P: Dynamics<NX, NU>,
{
    let with = |count| {
        let nodes = GaussLegendre::with_nodes(count);
        let ray = AlongRay {
            plant,
            x: *at.0,
            u: *at.1,
            nodes,
        };
        let f = |x: &SVector<f64, NX>, u: &SVector<f64, NU>| plant.f(x, u);
        let defect = embedding_defect::<_, NX, NU, NS>(&Unmended(ray), f, (x, u), points)?;
        Ok(RayNodes { nodes, defect })
    };
    let mut count = 1;
    loop {
        let found = with(count)?;
        if found.defect.relative <= tolerance || count == GaussLegendre::MOST {
            return Ok(found);
        }
        count += 1;
    }
}

/// The embedding along rays without what makes it exact.
struct Unmended<P, const NX: usize, const NU: usize, const NS: usize>(AlongRay<P, f64, NX, NU, NS>);

impl<P, const NX: usize, const NU: usize, const NS: usize> LpvModel<f64, NX, NU, NS>
    for Unmended<P, NX, NU, NS>
where
    P: Dynamics<NX, NU>,
{
    fn scheduling(&self, x: &SVector<f64, NX>, u: &SVector<f64, NU>) -> SVector<f64, NS> {
        self.0.scheduling(x, u)
    }

    fn matrices(
        &self,
        scheduling: &SVector<f64, NS>,
    ) -> (SMatrix<f64, NX, NX>, SMatrix<f64, NX, NU>) {
        self.0.matrices(scheduling)
    }

    fn offset(&self, scheduling: &SVector<f64, NS>) -> Option<SVector<f64, NX>> {
        let (a, b) = self.matrices(scheduling);
        let AlongRay { x, u, .. } = self.0;
        Some(self.0.derivative(&x, &u) - a * x - b * u)
    }
}
