"""A Stretch behind its driver, stretch_driver, as docs/reference/rosbridge.md#names-of-a-stretch.

What is awkward there is here, too: its wheels stop 0.5 s after the last Twist and follow none
outside of navigation mode; its head follows a goal however it was canceled, as fast as the goal's
velocity says, or as it can where that is 0; a goal within 0.2 s of a running one is rejected;
nothing is told while a run-stop waits for a goal to end.
"""

import math

from tests.support.late_body import LateBody, write_odometry

TWIST, ACTION = "geometry_msgs/Twist", "/stretch_controller/follow_joint_trajectory"
LOOP_S, TIMEOUT_S, GOAL_EVERY_S, GOAL_TIMEOUT_S = 1 / 30, 0.5, 0.2, 10.0
DEAD_TIME_S, LAG_S = 0.05, 0.08  # assumed: nobody has measured one for us
FASTEST_RAD_S, RAD_S2 = 6.0, 8.0  # of its servos
TOLERANCE_RAD = {"joint_head_pan": 0.15, "joint_head_tilt": 0.52, "joint_wrist_yaw": 0.015}
ABORTED, CANCELED, SUCCEEDED = 6, 5, 4


class Servo:
    """A joint by a servo: a profile of speed to its goal."""

    def __init__(self):
        self.at_rad = self.goal_rad = self.v_rad_s = 0.0
        self.fastest_rad_s, self.is_limp = FASTEST_RAD_S, False

    def move_by(self, by_rad, fastest_rad_s):
        if abs(by_rad) > 2e-5 and not self.is_limp:  # else nothing: what was begun goes on
            self.goal_rad = self.at_rad + by_rad
            self.fastest_rad_s = min(fastest_rad_s or FASTEST_RAD_S, FASTEST_RAD_S)

    def step(self, span_s):
        left_rad = self.goal_rad - self.at_rad
        braking = (2 * RAD_S2 * abs(left_rad)) ** 0.5
        wanted = min(self.fastest_rad_s, braking) * (1 if left_rad > 0 else -1)
        if self.is_limp or abs(left_rad) < 1e-3:
            wanted = 0.0
        most = RAD_S2 * span_s
        self.v_rad_s += max(-most, min(most, wanted - self.v_rad_s))
        self.at_rad += self.v_rad_s * span_s


class Goal:
    """A goal of the action server, from its acceptance to its end."""

    def __init__(self, robot, goal, respond):
        self.robot, self.respond = robot, respond
        self.began_s, self.is_active, self.is_canceled = robot.clock(), True, False
        trajectory = goal["trajectory"]
        (self.point,) = trajectory["points"]
        self.names = trajectory["joint_names"]

    def begin(self):
        for name, to_rad, fastest in zip(
            self.names, self.point["positions"], self.point["velocities"], strict=True
        ):
            servo = self.robot.joints[name]
            servo.move_by(to_rad - servo.at_rad, fastest)

    def cancel(self):
        # cancel_cb: the wheels are stopped, and each servo is told to move by 0, which it ignores.
        if self.is_active and not self.robot.waits_for_goal:
            self.robot.body.order(0.0, 0.0)
            self.is_canceled = True

    def end(self, status, text):
        self.is_active = False
        code = 0 if status == SUCCEEDED else -1
        self.respond({"error_code": code, "error_string": text}, status)

    def step(self):
        if not self.is_active:
            return
        errors = {
            name: abs(to_rad - self.robot.joints[name].at_rad)
            for name, to_rad in zip(self.names, self.point["positions"], strict=True)
        }
        if self.is_canceled:
            self.end(CANCELED, "")
        elif self is not self.robot.goal:
            self.end(ABORTED, "")
        elif all(error < TOLERANCE_RAD[name] for name, error in errors.items()):
            self.end(SUCCEEDED, "Achieved all target points.")
        elif self.robot.clock() - self.began_s > GOAL_TIMEOUT_S:
            self.end(ABORTED, "Time to execute the current goal point exceeded the timeout")


class FakeStretch:
    def __init__(self, graph, clock, mode="navigation"):
        self.graph, self.clock, self.mode = graph, clock, mode
        self.body = LateBody(clock, DEAD_TIME_S, LAG_S)
        self.rolled = (0.0, 0.0, 0.0)  # x, y and heading of its odometry
        self.joints = {name: Servo() for name in TOLERANCE_RAD}
        self.goals, self.goal, self.rejects = [], None, False
        self.is_run_stopped = self.is_charging = self.waits_for_goal = False
        self.orders, self.fastest_rad_s = [], 0.0
        self._twist, self._ordered_s, self._looped_s, self._goal_s = (0.0, 0.0), -9.0, -9.0, -9.0
        graph.subscribe("/stretch/cmd_vel", TWIST, self.follow)
        for topic, kind in (
            ("/odom", "nav_msgs/Odometry"),
            ("/mode", "std_msgs/String"),
            ("/is_runstopped", "std_msgs/Bool"),
            ("/battery", "sensor_msgs/BatteryState"),
            ("/stretch/joint_states", "sensor_msgs/JointState"),
        ):
            graph.advertise(topic, kind, "/stretch_driver")
        graph.actions[ACTION] = self

    @property
    def is_moving(self):
        return self.body.is_moving

    @property
    def are_joints_moving(self):
        return any(abs(servo.v_rad_s) > 0.01 for servo in self.joints.values())

    def angles(self):
        return {name: servo.at_rad for name, servo in self.joints.items()}

    def follow(self, message):
        twist = message["linear"]["x"], message["angular"]["z"]
        self.orders.append((self.clock(), *twist))
        if self.mode == "navigation":
            self._twist, self._ordered_s = twist, self.clock()

    def send(self, goal, respond):
        """Accept a goal, or reject it."""
        now_s, was = self.clock(), self.goal
        is_busy = was is not None and was.is_active and now_s - self._goal_s < GOAL_EVERY_S
        if self.rejects or is_busy or not set(goal["trajectory"]["joint_names"]) <= {*self.joints}:
            respond("Action goal was rejected", 0, result=False)
            return None
        self.goal, self._goal_s = Goal(self, goal, respond), now_s
        self.goals.append(self.goal)
        if self.mode not in ("position", "navigation"):
            self.goal.end(ABORTED, f"Cannot execute goals while in mode={self.mode}")
        else:
            self.goal.begin()
        return self.goal

    def switch(self, mode):
        """Bring its driver into a mode; in that of positions the wheels stand."""
        self.mode = mode
        self.body.order(0.0, 0.0)

    def press_run_stop(self, is_pressed):
        self.is_run_stopped = is_pressed
        for servo in self.joints.values():
            servo.is_limp = is_pressed
        self.body.is_braked = is_pressed  # by the boards of its motors

    def tell(self):
        """Let time pass, and run the driver's loop, 30 times a second."""
        for span_s in self.body.move():
            noise = 1 + self.body.chance.gauss(0, 0.02)
            v, _, w = (one * span_s * noise for one in self.body.velocity)
            self._roll(v, w)
            for servo in self.joints.values():
                servo.step(span_s)
                self.fastest_rad_s = max(self.fastest_rad_s, abs(servo.v_rad_s))
        for goal in self.goals:
            goal.step()
        self.goals = [goal for goal in self.goals if goal.is_active]
        if self.waits_for_goal:  # for the lock to change its mode
            self.waits_for_goal = bool(self.goals)
        elif self.clock() - self._looped_s >= LOOP_S - 1e-6:
            self._looped_s = self.clock()
            self._loop()

    def _roll(self, v_m, w_rad):
        x_m, y_m, heading_rad = self.rolled
        along = heading_rad + w_rad / 2
        x_m, y_m = x_m + v_m * math.cos(along), y_m + v_m * math.sin(along)
        self.rolled = (x_m, y_m, heading_rad + w_rad)

    def _loop(self):
        now_s, publish = self.clock(), self.graph.publish
        is_fresh = now_s - self._ordered_s < TIMEOUT_S
        if self.mode == "navigation":
            self.body.order(*(self._twist if is_fresh else (0.0, 0.0)))
        v, _, w = self.body.velocity
        publish("/odom", write_odometry(*self.rolled, (v, 0.0), w, now_s, ros=2))
        publish("/battery", {"voltage": 12.4, "present": self.is_charging})
        publish("/is_runstopped", {"data": self.is_run_stopped})
        publish("/mode", {"data": self.mode})
        names = ["wrist_extension", "joint_lift", *self.joints]
        at_rad = [0.1, 0.6, *(servo.at_rad for servo in self.joints.values())]
        publish("/stretch/joint_states", {"name": names, "position": at_rad, "velocity": []})
        if self.is_run_stopped != (self.mode == "runstopped"):
            self.mode = "runstopped" if self.is_run_stopped else "navigation"
            self.waits_for_goal = bool(self.goals)
