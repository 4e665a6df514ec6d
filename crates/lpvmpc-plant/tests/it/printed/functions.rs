//! `functions`: printed by `lpvmpc-plant` from its file; not to be edited.
//!
//! | | name | unit |
//! |---|---|---|
//! | x\[0\] | `a` | no unit |
//! | x\[1\] | `b` | no unit |
//! | x\[2\] | `c` | no unit |
//! | u\[0\] | `v` | no unit |
//! | u\[1\] | `w` | no unit |

#[allow(unused_imports, reason = "which of them are needed depends on the plant")]
use lpvmpc::{Bivariate, Dynamics, Elementary, Number};
#[allow(unused_imports, reason = "which of them are needed depends on the plant")]
use nalgebra::{SMatrix, SVector};

/// The plant `functions`, with the values of its parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Functions {
    /// `p`, no unit
    pub p: f64,
}

impl Default for Functions {
    fn default() -> Self {
        Self {
            p: 0.7,
        }
    }
}

#[allow(
    clippy::all,
    dead_code,
    unused_variables,
    reason = "printed from a straight-line program"
)]
impl Dynamics<3, 2> for Functions {
    fn f<N: Number>(&self, x: &SVector<N, 3>, u: &SVector<N, 2>) -> SVector<N, 3> {
        let g0 = N::constant(2.0);
        let g1 = N::constant(3.0);
        let g2 = N::constant(1.0);
        let g3 = N::constant(-1.3);
        let g4 = N::constant(9.0);
        let g5 = N::constant(0.0);
        let g6 = N::constant(self.p);
        let g7 = x[0];
        let g8 = x[1];
        let g9 = x[2];
        let g10 = u[0];
        let g11 = u[1];
        let v0 = g7.elementary(Elementary::Tanh);
        let v1 = v0 / g0;
        let v2 = v1.elementary(Elementary::Asin);
        let v3 = v1 * g10;
        let v4 = v3 / g1;
        let v5 = v4.elementary(Elementary::Acos);
        let v6 = v2 + v5;
        let v7 = g8 * g11;
        let v8 = v7.elementary(Elementary::Atan);
        let v9 = g7 / g0;
        let v10 = v9.elementary(Elementary::Sinh);
        let v11 = v8 * v10;
        let v12 = v6 - v11;
        let v13 = g8 / g0;
        let v14 = v13.elementary(Elementary::Cosh);
        let v15 = v12 + v14;
        let v16 = g7 * g8;
        let v17 = v16.elementary(Elementary::Asinh);
        let v18 = v15 + v17;
        let v19 = g9 * g9;
        let v20 = g0 + v19;
        let v21 = v20.elementary(Elementary::Acosh);
        let v22 = v18 - v21;
        let v23 = v1.elementary(Elementary::Atanh);
        let v24 = v1.tan();
        let v25 = v23 * v24;
        let v26 = v22 + v25;
        let v27 = g7 / g1;
        let v28 = v27.elementary(Elementary::Exp);
        let v29 = v26 + v28;
        let v30 = v20.elementary(Elementary::Ln);
        let v31 = g7 * g7;
        let v32 = g2 + v31;
        let v33 = v32.bivariate(g8, Bivariate::Power);
        let v34 = v30 + v33;
        let v35 = g8 * g8;
        let v36 = g0 + v35;
        let v37 = v36.bivariate(g3, Bivariate::Power);
        let v38 = v34 + v37;
        let v39 = g9 * v19;
        let v40 = v39 / v31;
        let v41 = v38 + v40;
        let v42 = g10 * g10;
        let v43 = g2 + v42;
        let v44 = v43.elementary(Elementary::Sqrt);
        let v45 = v41 + v44;
        let v46 = g8.bivariate(g9, Bivariate::Atan2);
        let v47 = v45 + v46;
        let v48 = g7 / g4;
        let v49 = v48.elementary(Elementary::ExpM1);
        let v50 = v47 + v49;
        let v51 = v35.elementary(Elementary::Ln1p);
        let v52 = v50 - v51;
        let v53 = g11 * g11;
        let v54 = v42 + v53;
        let v55 = v54.elementary(Elementary::Sqrt);
        let v56 = v52 + v55;
        let v57 = g1 + v53;
        let v58 = N::constant(1.0) / v57;
        let v59 = v56 + v58;
        let v60 = g7.elementary(Elementary::Abs);
        let v61 = g8.elementary(Elementary::Sign);
        let v62 = v61 * g9;
        let v63 = v60 + v62;
        let v64 = g7.bivariate(g8, Bivariate::Min);
        let v65 = g10.bivariate(g9, Bivariate::Max);
        let v66 = v64 * v65;
        let v67 = v63 - v66;
        let v68 = g1 * g11;
        let v69 = v68.elementary(Elementary::Floor);
        let v70 = v69 * g7;
        let v71 = v67 + v70;
        let v72 = g7.bivariate(g8, Bivariate::Less);
        let v73 = g10.elementary(Elementary::Sin);
        let v74 = v72.bivariate(v73, Bivariate::IfElseZero);
        let v75 = v72.bivariate(g5, Bivariate::Equal);
        let v76 = v75.bivariate(v19, Bivariate::IfElseZero);
        let v77 = v74 + v76;
        let v78 = v71 + v77;
        let v79 = g7.bivariate(g9, Bivariate::LessOrEqual);
        let v80 = g10.bivariate(g11, Bivariate::Equal);
        let v81 = v80.bivariate(g5, Bivariate::Equal);
        let v82 = v79 * v81;
        let v83 = g6 * g10;
        let v84 = v82.bivariate(v83, Bivariate::IfElseZero);
        let v85 = v82.bivariate(g5, Bivariate::Equal);
        let v86 = v85.bivariate(g8, Bivariate::IfElseZero);
        let v87 = v84 + v86;
        let v88 = v78 + v87;
        let v89 = g7.bivariate(g10, Bivariate::Less);
        let v90 = v89.bivariate(g5, Bivariate::Equal);
        let v91 = g8.bivariate(g11, Bivariate::LessOrEqual);
        let v92 = v90.bivariate(v91, Bivariate::Max);
        let v93 = v92.bivariate(g2, Bivariate::IfElseZero);
        let v94 = v92.bivariate(g5, Bivariate::Equal);
        let v95 = -g9;
        let v96 = v94.bivariate(v95, Bivariate::IfElseZero);
        let v97 = v93 + v96;
        let v98 = v88 + v97;
        SVector::<N, 3>::from([v29, v59, v98])
    }
}
