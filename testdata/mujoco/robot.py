"""A ballbot in MuJoCo, in a loop, with sensors, and its log as `ballbot identify` reads it.

Rigid bodies, the ball's contact with the floor and all motion in 3D are MuJoCo's. A wheel drives the
ball along its parallel of latitude and slides freely along the meridian; there the surfaces creep
against each other, by `compliance` times the force between them.
"""

import mujoco
import numpy as np

ZENITH = np.radians(45.0)
AZIMUTHS = np.radians([-90.0, 30.0, 150.0])
BALL, WHEEL, LEVER, GRAVITY = 0.12, 0.05, 0.30, 9.81
BODY_MASS, BALL_MASS = 9.0, 2.2
BODY_INERTIA = [0.45, 0.38, 0.12]  # about x, y, z at the centre of mass, wheels included
BALL_INERTIA = 0.6 * BALL_MASS * BALL**2
WHEEL_INERTIA = 0.006  # one wheel with its rotor, about its axle
WHEEL_FRICTION = 0.01  # N m s, of each axle
DELAY, TILT_OFFSET, GYRO_BIAS = 0.010, 0.010, 0.020
SENSES = np.array([1.0, -1.0])  # of offset and bias in the planes x and y
NOISE = 1e-3, 1e-3, 5e-3  # ball angle, tilt, rate
ROW, STEP = 5e-3, 2.5e-4

# Where the wheels touch the ball, and which way a positive angle drives its surface there.
NORMALS = np.array([[np.sin(ZENITH) * np.cos(a), np.sin(ZENITH) * np.sin(a), np.cos(ZENITH)] for a in AZIMUTHS])
DRIVES = np.array([[-np.sin(a), np.cos(a), 0.0] for a in AZIMUTHS])


def truth(plane=0):
    """The parameters of the plane x or y."""
    b2 = 1.5 * np.cos(ZENITH) ** 2 * (BALL / WHEEL) ** 2 * WHEEL_INERTIA / BODY_MASS
    return {
        "b1_m2": b2 + (BALL_INERTIA + (BALL_MASS + BODY_MASS) * BALL**2) / BODY_MASS,
        "b2_m2": b2,
        "b3_m2": b2 + LEVER**2 + BODY_INERTIA[1 - plane] / BODY_MASS,
        "delay_s": DELAY,
        "tilt_offset_rad": TILT_OFFSET * SENSES[plane],
    }


def model(floor):
    """The robot in MJCF; `floor` has the attributes of its contact, and the ratio of impedances."""
    contact, impratio = floor
    wheels = ""
    for i, (normal, drive) in enumerate(zip(NORMALS, DRIVES)):
        place, axle = " ".join(map(str, (BALL + WHEEL) * normal)), " ".join(map(str, np.cross(drive, normal)))
        wheels += f"""<body name="wheel{i}" pos="{place}"><inertial pos="0 0 0" mass="1e-6" diaginertia="1e-9 1e-9 1e-9"/>
          <joint name="axle{i}" axis="{axle}" armature="{WHEEL_INERTIA}" damping="{WHEEL_FRICTION}"/></body>"""
    inertia = " ".join(map(str, BODY_INERTIA))
    return mujoco.MjModel.from_xml_string(f"""<mujoco>
      <option timestep="{STEP}" gravity="0 0 -{GRAVITY}" cone="elliptic" impratio="{impratio}" integrator="implicitfast"/>
      <worldbody><geom type="plane" size="50 50 1" friction="0.9 0.002 0.0001" {contact}/>
      <body name="body" pos="0 0 {BALL}"><freejoint/>
        <inertial pos="0 0 {LEVER}" mass="{BODY_MASS}" diaginertia="{inertia}"/>{wheels}
        <body name="ball"><joint type="ball"/>
          <inertial pos="0 0 0" mass="{BALL_MASS}" diaginertia="{BALL_INERTIA} {BALL_INERTIA} {BALL_INERTIA}"/>
          <geom type="sphere" size="{BALL}" mass="0" condim="4" friction="0.9 0.002 0.0001" {contact}/></body>
      </body></worldbody></mujoco>""")


def virtual(motors):
    """What the wheels' angles amount to in the planes x and y: of the ball against the body, rad."""
    along = 2.0 / (3.0 * np.cos(ZENITH)) * WHEEL / BALL
    return along * np.array([-np.sin(AZIMUTHS) @ motors, np.cos(AZIMUTHS) @ motors])


def motors(torques):
    """The motors' torques for (tau_x, tau_y, tau_z)."""
    along = 2.0 / (3.0 * np.cos(ZENITH)) * (-np.sin(AZIMUTHS) * torques[0] + np.cos(AZIMUTHS) * torques[1])
    return along + torques[2] / (3.0 * np.sin(ZENITH))


def record(path, excitation, gain, compliance, floor, seed):
    """Runs the robot under `excitation` (planes x and y, N m, a row each) in the loop u = -gain x, and logs."""
    robot = model(floor)
    data = mujoco.MjData(robot)
    ball = robot.body("ball").id
    wheels = [robot.body(f"wheel{i}").id for i in range(3)]
    angles = [robot.joint(f"axle{i}").qposadr[0] for i in range(3)]
    rates = [robot.joint(f"axle{i}").dofadr[0] for i in range(3)]
    rng = np.random.default_rng(seed)
    waiting = [np.zeros(3)] * round(DELAY / STEP)
    rows, jacobian = [], np.zeros((3, robot.nv))
    mujoco.mj_forward(robot, data)
    for time, added in zip(ROW * np.arange(len(excitation)), excitation):
        for update in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_comVel):
            update(robot, data)
        turn = data.body("body").xmat.reshape(3, 3)
        tilt = np.arctan2(turn[:2, 2], turn[2, 2])
        omega = turn.T @ data.body("body").cvel[:3]
        rate = np.array([omega[1], -omega[0]])
        seen = tilt + NOISE[1] * rng.standard_normal(2), rate + NOISE[2] * rng.standard_normal(2)
        encoders = data.qpos[angles] + NOISE[0] * BALL / WHEEL * rng.standard_normal(3)
        phi, phi_dot = virtual(data.qpos[angles]) + tilt, virtual(data.qvel[rates]) + rate
        planes = [-gain @ np.array([phi[i], seen[0][i], phi_dot[i], seen[1][i]]) for i in range(2)]
        torque = motors([planes[0] + added[0], planes[1] + added[1], 0.5 * omega[2]])
        shown = *(seen[0] + TILT_OFFSET * SENSES), *(seen[1] + GYRO_BIAS * SENSES)
        rows.append([time, *encoders, *shown, *torque])
        for _ in range(round(ROW / STEP)):
            waiting.append(torque)
            mujoco.mj_step1(robot, data)
            centre, turn = data.body("ball").xpos, data.body("body").xmat.reshape(3, 3)
            slip = np.zeros((3, robot.nv))
            for i in range(3):
                for body, sign in ((ball, 1.0), (wheels[i], -1.0)):
                    mujoco.mj_jac(robot, data, jacobian, None, centre + turn @ NORMALS[i] * BALL, body)
                    slip[i] += sign * (turn @ DRIVES[i]) @ jacobian
            # The forces that leave compliance times themselves as slip at the end of the step.
            data.qfrc_applied[:] = 0.0
            data.qfrc_applied[rates] = waiting.pop(0)
            response = np.zeros((3, robot.nv))
            mujoco.mj_solveM(robot, data, response, slip)
            free = response @ (data.qfrc_applied + data.qfrc_passive - data.qfrc_bias)
            stiffness = compliance * np.eye(3) + STEP * slip @ response.T
            data.qfrc_applied += slip.T @ -np.linalg.solve(stiffness, slip @ data.qvel + STEP * free)
            mujoco.mj_step2(robot, data)
    np.savetxt(path, rows, delimiter=",", header="t_s,w1,w2,w3,theta_x,theta_y,theta_dot_x,theta_dot_y,m1,m2,m3", comments="")
