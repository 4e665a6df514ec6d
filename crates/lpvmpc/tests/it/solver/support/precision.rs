//! A problem in another number type.

use lpvmpc::{Bounds, Common, GeneralRow, List, Ocp, Penalty, Scalar, SoftBounds, Stage, Terminal};
use nalgebra::SMatrix;

/// Rounded to `f32`.
pub fn single<const NX: usize, const NU: usize>(ocp: &Ocp<f64, NX, NU>) -> Ocp<f32, NX, NU> {
    Into(&|x: f64| x as f32).problem(ocp)
}

/// As it is, in `f64`.
pub fn double<const NX: usize, const NU: usize>(ocp: &Ocp<f32, NX, NU>) -> Ocp<f64, NX, NU> {
    Into(&|x: f32| f64::from(x)).problem(ocp)
}

/// What turns a number into the other type.
struct Into<'a, A, B>(&'a dyn Fn(A) -> B);

impl<A: Scalar, B: Scalar> Into<'_, A, B> {
    fn matrix<const R: usize, const C: usize>(&self, m: &SMatrix<A, R, C>) -> SMatrix<B, R, C> {
        m.map(self.0)
    }

    fn bounds<const K: usize>(&self, bounds: &Bounds<A, K>) -> Bounds<B, K> {
        Bounds {
            lower: self.matrix(&bounds.lower),
            upper: self.matrix(&bounds.upper),
        }
    }

    fn price(&self, soft: &Option<Penalty<A>>) -> Option<Penalty<B>> {
        soft.map(|price| Penalty {
            linear: (self.0)(price.linear),
            quadratic: (self.0)(price.quadratic),
        })
    }

    fn prices<const K: usize>(&self, soft: &SoftBounds<A, K>) -> SoftBounds<B, K> {
        soft.each_ref().map(|price| self.price(price))
    }

    fn stage<const NX: usize, const NU: usize>(
        &self,
        stage: &Stage<A, NX, NU>,
    ) -> Stage<B, NX, NU> {
        Stage {
            a: self.matrix(&stage.a),
            b: self.matrix(&stage.b),
            c: self.matrix(&stage.c),
            linear_x: self.matrix(&stage.linear_x),
            linear_u: self.matrix(&stage.linear_u),
        }
    }

    fn common<const NX: usize, const NU: usize>(
        &self,
        common: &Common<A, NX, NU>,
    ) -> Common<B, NX, NU> {
        Common {
            q: self.matrix(&common.q),
            r: self.matrix(&common.r),
            s: self.matrix(&common.s),
            x: self.bounds(&common.x),
            soft_x: self.prices(&common.soft_x),
            u: self.bounds(&common.u),
        }
    }

    fn row<const NX: usize, const NU: usize>(
        &self,
        row: &GeneralRow<A, NX, NU>,
    ) -> GeneralRow<B, NX, NU> {
        GeneralRow {
            x: self.matrix(&row.x),
            u: self.matrix(&row.u),
            lower: (self.0)(row.lower),
            upper: (self.0)(row.upper),
            soft: self.price(&row.soft),
        }
    }

    fn problem<const NX: usize, const NU: usize>(&self, ocp: &Ocp<A, NX, NU>) -> Ocp<B, NX, NU> {
        let end = &ocp.terminal;
        Ocp {
            x0: self.matrix(&ocp.x0),
            stages: list(&ocp.stages, |stage| self.stage(stage)),
            common: self.common(&ocp.common),
            own: list(&ocp.own, |common| self.common(common)),
            rows: list(&ocp.rows, |row| self.row(row)),
            rows_per_stage: ocp.rows_per_stage,
            terminal: Terminal {
                p: self.matrix(&end.p),
                linear_x: self.matrix(&end.linear_x),
                x: self.bounds(&end.x),
                soft_x: self.prices(&end.soft_x),
                equality: end.equality.as_ref().map(|target| self.matrix(target)),
            },
            horizon: ocp.horizon,
        }
    }
}

fn list<A, B>(from: &[A], convert: impl Fn(&A) -> B) -> List<B> {
    List::Owned(from.iter().map(convert).collect())
}
