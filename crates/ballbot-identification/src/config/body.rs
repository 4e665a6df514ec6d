//! `[body]`: what scales and a drawing say of the parameters.

use super::{ConfigError, positive, within};
use crate::coordinates::Coordinates;
use crate::parameter::{Choice, Parameter, Values};
use crate::words::number;
use ballbot::Geometry;
use lpvmpc_design::number_text;
use serde::Deserialize;

/// The body: its mass, weighed; or, with all of the rest, masses and inertias from a drawing.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyTable {
    /// m_a, kg, wheels and motors included, without the ball. Alone it holds the torque gain.
    pub body_mass_kg: f64,
    /// I_a about the centre of mass, kg m^2.
    pub body_inertia_kg_m2: Option<f64>,
    /// m_k, kg.
    pub ball_mass_kg: Option<f64>,
    /// I_k, kg m^2.
    pub ball_inertia_kg_m2: Option<f64>,
    /// I_w of one wheel with its motor's rotor as seen at the wheel, kg m^2.
    pub wheel_inertia_kg_m2: Option<f64>,
    /// Angle of the wheels' contact points from the top of the ball, degrees.
    pub zenith_angle_deg: Option<f64>,
    /// Relative standard deviation of what follows from these numbers.
    pub uncertainty: Option<f64>,
}

/// Masses and inertias from a drawing: they become priors of b1, b2, b3 and the torque gain.
struct Drawing {
    body_mass: f64,
    body_inertia: f64,
    ball_mass: f64,
    ball_inertia: f64,
    wheel_inertia: f64,
    zenith_angle: f64,
    uncertainty: f64,
}

impl BodyTable {
    /// What it says of the parameters.
    pub(super) fn choose(
        &self,
        geometry: &Geometry<f64>,
        choices: &mut Values<Choice>,
    ) -> Result<(), ConfigError> {
        let coordinates = Coordinates::new(choices, *geometry, true);
        let (lightest, heaviest) = coordinates.masses();
        let expected = format!(
            "from {} to {} kg, with its centre of mass at {} m",
            number(lightest),
            number(heaviest),
            number_text(geometry.centre_of_mass)
        );
        within(
            "body.body_mass_kg",
            self.body_mass_kg,
            lightest,
            heaviest,
            expected,
        )?;
        match self.drawing()? {
            Some(drawing) => drawing.priors(geometry, choices),
            None => choices[Parameter::TorqueGain] = Choice::Fixed(1.0 / self.body_mass_kg),
        }
        Ok(())
    }

    /// The drawing, if there is one.
    fn drawing(&self) -> Result<Option<Drawing>, ConfigError> {
        let keys = [
            ("body.body_inertia_kg_m2", self.body_inertia_kg_m2),
            ("body.ball_mass_kg", self.ball_mass_kg),
            ("body.ball_inertia_kg_m2", self.ball_inertia_kg_m2),
            ("body.wheel_inertia_kg_m2", self.wheel_inertia_kg_m2),
            ("body.zenith_angle_deg", self.zenith_angle_deg),
            ("body.uncertainty", self.uncertainty),
        ];
        if keys.iter().all(|(_, value)| value.is_none()) {
            return Ok(None);
        }
        let mut values = [0.0; 6];
        for (place, (key, value)) in values.iter_mut().zip(keys) {
            *place = value.ok_or(ConfigError::IncompleteBody { key })?;
            positive(key, *place)?;
        }
        let [
            body_inertia,
            ball_mass,
            ball_inertia,
            wheel_inertia,
            angle,
            uncertainty,
        ] = values;
        let degrees = "from 1 to 89 degrees";
        within("body.zenith_angle_deg", angle, 1.0, 89.0, degrees)?;
        Ok(Some(Drawing {
            body_mass: self.body_mass_kg,
            body_inertia,
            ball_mass,
            ball_inertia,
            wheel_inertia,
            zenith_angle: angle.to_radians(),
            uncertainty,
        }))
    }
}

impl Drawing {
    /// b2 = 3/2 cos^2(alpha) (r_b/r_w)^2 I_w/m_a, b1 = b2 + (I_k + (m_k + m_a) r_b^2)/m_a,
    /// b3 = b2 + l^2 + I_a/m_a.
    fn priors(&self, geometry: &Geometry<f64>, choices: &mut Values<Choice>) {
        let mass = self.body_mass;
        let gear = geometry.ball_radius / geometry.wheel_radius;
        let cos = self.zenith_angle.cos();
        let b2 = 1.5 * (cos * gear).powi(2) * self.wheel_inertia / mass;
        let rolling = (self.ball_mass + mass) * geometry.ball_radius.powi(2);
        let b1 = b2 + (self.ball_inertia + rolling) / mass;
        let b3 = b2 + geometry.centre_of_mass.powi(2) + self.body_inertia / mass;
        for (parameter, mean) in [
            (Parameter::B1, b1),
            (Parameter::B2, b2),
            (Parameter::B3, b3),
            (Parameter::TorqueGain, 1.0 / mass),
        ] {
            choices[parameter] = Choice::Prior {
                mean,
                standard_deviation: self.uncertainty * mean,
            };
        }
    }
}
