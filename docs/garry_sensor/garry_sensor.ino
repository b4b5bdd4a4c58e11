// A sensor for `python -m rehab.sources serial_sensor`: force under the foot and ankle angle.
//
// Each line is a frame: $BODY*XX, where XX is the exclusive or of BODY's bytes in hexadecimal.
//   $H,name,name*XX              the names, at the start and every second
//   $D,microseconds,cell,cell*XX a sample; an empty cell is a channel without a sample now
// Put your own sensors into readForce() and readAngle(). Without an ankle moment there is no A2:
// compute it here as readMoment(), plantarflexion positive, in newton meters.

const unsigned long STEP_US = 5000;  // 200 samples a second
const char NAMES[] = "left_force_n,left_moment_nm,left_angle_rad";

float readForce() { return analogRead(A0) * 1.5; }              // N, upward positive
float readAngle() { return (analogRead(A1) - 512) * 0.00153; }  // rad, plantarflexion positive
float readMoment() { return readForce() * 0.12; }               // Nm: force × its lever on the ankle

void sendFrame(const char *body) {
  byte check = 0;
  for (const char *at = body; *at; at++) check ^= *at;
  char end[6];
  snprintf(end, sizeof end, "*%02X\n", check);
  Serial.print('$');
  Serial.print(body);
  Serial.print(end);
}

void setup() { Serial.begin(921600); }

void loop() {
  static unsigned long next = micros();
  static unsigned long sample = 0;
  if ((long)(micros() - next) < 0) return;
  unsigned long now = micros();
  next += STEP_US;
  char body[96];
  if (sample++ % (1000000 / STEP_US) == 0) {
    snprintf(body, sizeof body, "H,%s", NAMES);
    sendFrame(body);
  }
  char force[16], moment[16], angle[16];
  dtostrf(readForce(), 1, 2, force);
  dtostrf(readMoment(), 1, 3, moment);
  dtostrf(readAngle(), 1, 4, angle);
  snprintf(body, sizeof body, "D,%lu,%s,%s,%s", now, force, moment, angle);
  sendFrame(body);
}
