//! Certificates that claim what is not so, each forged in another way.

use crate::plants::{CART_POLE, REACTOR};
use lpvmpc_certify::{Certificate, CertifyError, verify, verify_text};

type Forge = fn(&mut Certificate);

fn refused(forge: Forge) -> CertifyError {
    let (plant, certificate) = &*REACTOR;
    let mut forged = certificate.clone();
    forge(&mut forged);
    verify(&forged, plant, &|_| ()).expect_err("a forgery was proved")
}

#[test]
fn false_claims_are_told_from_those_that_could_not_be_shown() {
    let cases: [(Forge, &str); 9] = [
        (|c| c.level *= 30.0, "the set reaches"),
        (
            |c| c.contraction = 0.9,
            "the claimed decrease of x'Px is false",
        ),
        (
            |c| c.k[0].iter_mut().for_each(|k| *k = -*k),
            "the claimed decrease of x'Px is false",
        ),
        (
            |c| c.k[0].iter_mut().for_each(|k| *k = 0.0),
            "the claimed decrease of x'Px is false",
        ),
        (
            |c| c.q[0][0] *= 1e4,
            "the claimed decrease of x'Px is false",
        ),
        (
            |c| c.r[0][0] *= 1e3,
            "the claimed decrease of x'Px is false",
        ),
        (|c| c.state_limits[1] = Some(1.0), "state_limits[1]"),
        (|c| c.input_limits[0] = Some(0.1), "input_limits[0]"),
        (|c| c.equilibrium.x[1] += 0.5, "equilibrium: it is none"),
    ];
    for (forge, expected) in cases {
        let error = refused(forge);
        assert!(error.to_string().contains(expected), "{error}");
        assert!(error.is_false(), "{error}");
    }
}

#[test]
fn what_makes_no_sense_is_refused() {
    let cases: [(Forge, &str); 13] = [
        // Proved where the plant stands, which the law is not about.
        (
            |c| {
                c.equilibrium.x[1] += 0.01;
                c.equilibrium.within = vec![1e3; 3];
            },
            "equilibrium.within: the plant may stand 1000 away",
        ),
        (|c| c.level = f64::NAN, "terminal.level"),
        (|c| c.level = -1.0, "terminal.level"),
        (|c| c.p[0][1] += 1e-9, "terminal.p is not symmetric"),
        (
            |c| c.p[0][0] = -1.0,
            "terminal.p could not be shown to be positive definite",
        ),
        (
            |c| c.q[0][0] = -1.0,
            "q could not be shown to be positive semidefinite",
        ),
        (
            |c| c.r[0][0] = 0.0,
            "r could not be shown to be positive definite",
        ),
        (|c| c.contraction = -0.5, "terminal.contraction"),
        (|c| c.t_s = 0.0, "t_s"),
        (
            |c| c.k[0].truncate(1),
            "k: it must have 1 rows of 2 numbers",
        ),
        (
            |c| c.equilibrium.within[0] = -1.0,
            "distances that are not negative",
        ),
        (|c| c.equilibrium.within = vec![0.0; 3], "equilibrium"),
        (|c| c.plant.sha256 = "0".repeat(64), "of another plant"),
    ];
    for (forge, expected) in cases {
        let error = refused(forge);
        assert!(error.to_string().contains(expected), "{error}");
    }
}

/// The plant's hash is part of the document: the law of one cannot be shown for another, and a changed parameter makes
/// another plant.
#[test]
fn a_forger_who_claims_another_plant_has_to_prove_it() {
    let (plant, certificate) = &*CART_POLE;
    // Gravity is a constant of its formulas: a third more.
    let text = plant.to_json().replace("9.81", "13.1");
    let heavier = lpvmpc_plant::Plant::from_json(&text).unwrap();
    assert!(matches!(
        verify(certificate, &heavier, &|_| ()),
        Err(CertifyError::AnotherPlant { .. })
    ));
    let mut forged = certificate.clone();
    let Err(CertifyError::AnotherPlant { found, .. }) = verify(certificate, &heavier, &|_| ())
    else {
        panic!("it is another plant");
    };
    forged.plant.sha256 = found;
    let error = verify(&forged, &heavier, &|_| ()).unwrap_err();
    assert!(matches!(error, CertifyError::Claim(_)), "{error}");
}

#[test]
fn a_changed_text_is_found_out() {
    let (plant, certificate) = &*REACTOR;
    let text = certificate.to_json().unwrap();
    // Another true claim, with the digest of the one that was written.
    let mut smaller = certificate.clone();
    smaller.level *= 0.5;
    let digest = |text: &str| text.rsplit_once("\"digest\"").unwrap().1.to_owned();
    let other = smaller.to_json().unwrap();
    let (content, _) = other.rsplit_once("\"digest\"").unwrap();
    let patched = format!("{content}\"digest\"{}", digest(&text));
    assert!(verify(&smaller, plant, &|_| ()).is_ok());
    let error = verify_text(&patched, plant, &|_| ())
        .unwrap_err()
        .to_string();
    assert!(error.contains("was changed"), "{error}");
    assert!(Certificate::from_json(&patched).is_err());
    for text in [
        "",
        "{}",
        "[1, 2",
        &text.replace("\"level\"", "\"levels\""),
        &text.replace("\"t_s\"", "\"t_s\": 1, \"t_s\""),
    ] {
        assert!(matches!(
            verify_text(text, plant, &|_| ()),
            Err(CertifyError::Document(_))
        ));
    }
}
