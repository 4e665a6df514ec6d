//! The result as a TOML file.

use crate::estimate::Status;
use crate::identification::Identification;
use crate::parameter::Parameter;
use crate::verdict::Verdict;
use std::fmt::Write as _;

impl Identification {
    /// `parameters.toml`: the robot as a `[parameters]` table of a scenario, what does not fit into
    /// that, and the covariance.
    ///
    /// # Errors
    /// The verdicts that forbid it: what was found is no robot.
    pub fn parameter_file(&self) -> Result<String, Vec<Verdict>> {
        let refusals = self.refusals();
        if !refusals.is_empty() {
            return Err(refusals);
        }
        let mut text = String::new();
        let robot = self.ballbot();
        let geometry = &robot.geometry;
        // Writing to a string cannot fail; {:?} gives the shortest digits that read back the same.
        let _ = write!(
            text,
            "# A ballbot identified by `ballbot identify`.\n\
             # Scenarios take it as `parameters = \"this file\"`, and all commands with a robot as \
             `--parameters`.\n\n\
             [parameters]\nb1_m2 = {:?}\nb2_m2 = {:?}\nb3_m2 = {:?}\nb4_m2_s = {:?}\n\
             drive_friction_m2_s = {:?}\ndrive_coulomb_m2_s2 = {:?}\n\
             centre_of_mass_m = {:?}\nball_radius_m = {:?}\n\
             # r_w / gain = {:?} / {:?}: torque enters by r_b / r_w alone, so the gain (1 / body mass) is\n\
             # in it, and the model's torque is in N m.\n\
             wheel_radius_m = {:?}\ngravity_m_s2 = {:?}\n",
            robot.b1,
            robot.b2,
            robot.b3,
            robot.b4,
            robot.drive.viscous,
            robot.drive.coulomb,
            geometry.centre_of_mass,
            geometry.ball_radius,
            self.geometry.wheel_radius,
            self.estimate.values[Parameter::TorqueGain],
            geometry.wheel_radius,
            geometry.gravity,
        );
        let _ = write!(
            text,
            "\n# All that was found or held, with standard deviations.\n"
        );
        for parameter in Parameter::ALL {
            let status = match self.estimate.status[parameter] {
                Status::Held => "held",
                Status::Found => "found",
                Status::AtBound => "at its bound",
            };
            let _ = write!(
                text,
                "\n[identification.{}] # {}\nvalue = {:?} # {}\nstandard_deviation = {:?}\n\
                 status = \"{status}\"\n",
                parameter.key(),
                parameter.words(),
                self.estimate.values[parameter],
                parameter.unit(),
                self.standard_deviation(parameter),
            );
        }
        let keys = Parameter::ALL.map(|parameter| format!("\"{parameter}\""));
        let _ = write!(
            text,
            "\n[identification.covariance]\nparameters = [{}]\nmatrix = [\n",
            keys.join(", ")
        );
        for row in self.covariance().row_iter() {
            let entries: Vec<String> = row.iter().map(|entry| format!("{entry:?}")).collect();
            let _ = writeln!(text, "    [{}],", entries.join(", "));
        }
        Ok(text + "]\n")
    }
}
