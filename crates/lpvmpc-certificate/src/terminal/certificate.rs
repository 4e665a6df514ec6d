//! The certificate of a terminal set: a file that says what holds, with all that is needed to
//! prove it again.

use super::document::{limits, rows};
use nalgebra::{SMatrix, SVector};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{self, Read};
use std::path::Path;
use thiserror::Error;

/// What is claimed of a plant under the terminal law u = **-K** x, held over each sample, and the
/// numbers that the claims are about. See `docs/certificate.md`.
///
/// `Plant` holds the plant's parameters, and nothing else: they are part of what is proved.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(
    deny_unknown_fields,
    bound(
        serialize = "Plant: Serialize",
        deserialize = "Plant: Deserialize<'de>"
    )
)]
pub struct Certificate<Plant, const NX: usize, const NU: usize, const NS: usize> {
    /// Program and version that wrote the file.
    pub written_by: String,
    /// The plant's parameters.
    pub plant: Plant,
    /// Sampling time, s.
    pub t_s: f64,
    /// Q of the stage cost x'Qx + u'Ru, symmetric, positive semidefinite.
    #[serde(with = "rows")]
    pub q: SMatrix<f64, NX, NX>,
    /// R of the stage cost, symmetric, positive definite.
    #[serde(with = "rows")]
    pub r: SMatrix<f64, NU, NU>,
    /// |x_i| <= `state_limits[i]`, state units; `null` in the file, infinite here, for none.
    #[serde(with = "limits")]
    pub state_limits: SVector<f64, NX>,
    /// |u_i| <= `input_limits[i]`, input units.
    #[serde(with = "limits")]
    pub input_limits: SVector<f64, NU>,
    /// The scheduling box |s_i| <= `scheduling_limits[i]`.
    #[serde(with = "limits")]
    pub scheduling_limits: SVector<f64, NS>,
    /// Law, cost and set.
    pub terminal: TerminalClaim<NX, NU>,
    /// Quadratic stability in continuous time.
    pub continuous: QuadraticClaim<NX>,
    /// What the run that wrote the file found; not part of the claims.
    pub record: Record,
}

/// The terminal set x'Px <= level: every motion of the sampled nonlinear plant that starts in it
/// under u = -K x0, held over a sample, satisfies
/// V(x+) <= (1 - contraction) V(x) - x'Qx - u'Ru with V(x) = x'Px.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TerminalClaim<const NX: usize, const NU: usize> {
    /// K, for u = **-K** x.
    #[serde(with = "rows")]
    pub k: SMatrix<f64, NU, NX>,
    /// P, symmetric positive definite.
    #[serde(with = "rows")]
    pub p: SMatrix<f64, NX, NX>,
    /// The set is x'Px <= level, in units of the cost.
    pub level: f64,
    /// The share of V by which it decreases beyond the stage cost, at least.
    pub contraction: f64,
}

impl<const NX: usize, const NU: usize> TerminalClaim<NX, NU> {
    /// The largest |x_i| in the set, state units; NaN if P is singular.
    pub fn largest_states(&self) -> SVector<f64, NX> {
        let inverse = self.p.try_inverse();
        SVector::from_fn(|i, _| {
            inverse.map_or(f64::NAN, |inverse| (self.level * inverse[(i, i)]).sqrt())
        })
    }
}

/// (A - BK)'P + P(A - BK) <= -2 rate P at every scheduling of the box, with A and B in continuous
/// time: x'Px decreases under the law without sampling, however the scheduling moves in the box.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct QuadraticClaim<const NX: usize> {
    /// P, symmetric positive definite; another matrix than that of the terminal cost.
    #[serde(with = "rows")]
    pub p: SMatrix<f64, NX, NX>,
    /// Rate of decay of |x|_P, 1/s.
    pub rate_1_s: f64,
}

/// What the proof took when the file was written.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// Boxes of initial states on which the decrease was proved.
    pub boxes: usize,
    /// The smallest contraction that a box would have carried.
    pub smallest_contraction: f64,
    /// Boxes of schedulings on which quadratic stability was proved.
    pub scheduling_boxes: usize,
}

/// A longer file is no certificate: that of a plant with 20 states has some 50 kB.
pub const MOST_BYTES: usize = 256 * 1024;

/// The text of a certificate's file, of which not more is read than a certificate can have: what
/// follows makes it none.
///
/// # Errors
/// The file cannot be read, or is not text.
pub fn read_certificate(path: &Path) -> io::Result<String> {
    let mut text = String::new();
    let most = MOST_BYTES as u64 + 1;
    File::open(path)?.take(most).read_to_string(&mut text)?;
    Ok(text)
}

/// A certificate file that cannot be read.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum DocumentError {
    /// More text than a certificate can have.
    #[error("not a certificate: it has more than {MOST_BYTES} bytes")]
    TooLong,
    /// Not JSON, an unknown, missing or repeated key, or a value of the wrong type.
    #[error("not a certificate: {0}")]
    Syntax(String),
    /// The numbers are not those that were written.
    #[error(
        "the digest is {written}, but that of the content is {computed}: the file was changed \
         after it was written"
    )]
    Digest {
        /// What the file says.
        written: String,
        /// What its content gives.
        computed: String,
    },
}

/// The file: a certificate and the digest of its content.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document<C> {
    certificate: C,
    digest: String,
}

impl<Plant, const NX: usize, const NU: usize, const NS: usize> Certificate<Plant, NX, NU, NS>
where
    Plant: Serialize + DeserializeOwned,
{
    /// The file's text.
    ///
    /// # Errors
    /// The plant cannot be written as JSON.
    pub fn to_json(&self) -> Result<String, DocumentError> {
        document_text(self)
    }

    /// The certificate in a file's text, **without** a look at its digest: see
    /// [`Self::check_digest`]. A changed claim is so told by what it claims.
    ///
    /// # Errors
    /// [`DocumentError::TooLong`] or [`DocumentError::Syntax`].
    pub fn from_json(text: &str) -> Result<Self, DocumentError> {
        document_content(text)
    }

    /// Whether the text is as it was written. The digest has no key: it finds a slip or a patched
    /// number, not a forger, and what a forger claims has still to pass the proof.
    ///
    /// # Errors
    /// [`DocumentError`].
    pub fn check_digest(text: &str) -> Result<(), DocumentError> {
        check_document_digest::<Self>(text)
    }
}

/// The text of a file with this content and its digest.
///
/// # Errors
/// The content cannot be written as JSON.
pub fn document_text<C: Serialize>(content: &C) -> Result<String, DocumentError> {
    let document = Document {
        certificate: content,
        digest: digest(content)?,
    };
    let text = serde_json::to_string_pretty(&document).map_err(DocumentError::syntax)?;
    Ok(text + "\n")
}

/// The content of such a text, **without** a look at its digest.
///
/// # Errors
/// [`DocumentError::TooLong`] or [`DocumentError::Syntax`].
pub fn document_content<C: DeserializeOwned>(text: &str) -> Result<C, DocumentError> {
    Ok(document::<C>(text)?.certificate)
}

/// Whether the text is as it was written; see [`Certificate::check_digest`].
///
/// # Errors
/// [`DocumentError`].
pub fn check_document_digest<C: Serialize + DeserializeOwned>(
    text: &str,
) -> Result<(), DocumentError> {
    let document = document::<C>(text)?;
    let computed = digest(&document.certificate)?;
    if computed == document.digest {
        Ok(())
    } else {
        Err(DocumentError::Digest {
            written: document.digest,
            computed,
        })
    }
}

fn document<C: DeserializeOwned>(text: &str) -> Result<Document<C>, DocumentError> {
    if text.len() > MOST_BYTES {
        return Err(DocumentError::TooLong);
    }
    serde_json::from_str(text).map_err(DocumentError::syntax)
}

/// FNV-1a (Fowler, Noll, Vo), 64 bits, of the compact JSON text of the content.
fn digest<C: Serialize>(content: &C) -> Result<String, DocumentError> {
    let text = serde_json::to_string(content).map_err(DocumentError::syntax)?;
    let hash = text.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    Ok(format!("{hash:016x}"))
}

impl DocumentError {
    fn syntax(error: serde_json::Error) -> Self {
        Self::Syntax(error.to_string())
    }
}
