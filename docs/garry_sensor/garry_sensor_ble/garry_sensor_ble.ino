// A sensor on a foot or shank for `python -m rehab.sources ble`: an Arduino Nano 33 BLE Sense Rev2.
//
// Library manager: ArduinoBLE, Arduino_BMI270_BMM150. Lines go out by the Nordic UART service:
//   $H,frame,ax,ay,az,gx,gy,gz*XX   the names, at the start and every second
//   $D,microseconds,cell,…*XX       a sample: its number, m/s², rad/s
//   $T,number,microseconds*XX       the answer to a line T,number: what time it is here
// XX is the exclusive or of the bytes between $ and *, in hexadecimal.

#include <ArduinoBLE.h>
#include <Arduino_BMI270_BMM150.h>

const char NAME[] = "GARRY-1";  // a name of its own for each sensor
const char NAMES[] = "H,frame,ax,ay,az,gx,gy,gz";
const int PART = 180;  // bytes of a notification; computers agree on 185 or more

BLEService uart("6E400001-B5A3-F393-E0A9-E50E24DCCA9E");
BLECharacteristic asked("6E400002-B5A3-F393-E0A9-E50E24DCCA9E", BLEWriteWithoutResponse, 20);
BLECharacteristic told("6E400003-B5A3-F393-E0A9-E50E24DCCA9E", BLENotify, PART);

char waiting[PART];
int length = 0;

void sendWaiting() {
  if (length) told.writeValue((const uint8_t *)waiting, length);
  length = 0;
}

void sendFrame(const char *body) {
  byte check = 0;
  for (const char *at = body; *at; at++) check ^= *at;
  char line[96];
  int size = snprintf(line, sizeof line, "$%s*%02X\n", body, check);
  if (length + size > PART) sendWaiting();
  memcpy(waiting + length, line, size);
  length += size;
}

void setup() {
  if (!IMU.begin() || !BLE.begin()) while (true) digitalWrite(LED_BUILTIN, millis() / 200 % 2);
  BLE.setLocalName(NAME);
  BLE.setConnectionInterval(6, 12);  // of 1.25 ms
  BLE.setAdvertisedService(uart);
  uart.addCharacteristic(asked);
  uart.addCharacteristic(told);
  BLE.addService(uart);
  BLE.advertise();
}

void loop() {
  static unsigned long sample = 0;
  BLE.poll();
  char body[88];
  if (asked.written()) {
    unsigned long now = micros();
    char question[21] = {0};
    memcpy(question, asked.value(), min(asked.valueLength(), 20));
    sendWaiting();
    snprintf(body, sizeof body, "T,%d,%lu", atoi(question + 2), now);
    sendFrame(body);
    sendWaiting();
  }
  if (!IMU.accelerationAvailable() || !IMU.gyroscopeAvailable()) return;
  unsigned long now = micros();
  float ax, ay, az, gx, gy, gz;
  IMU.readAcceleration(ax, ay, az);  // g
  IMU.readGyroscope(gx, gy, gz);     // degrees a second
  if (sample % 100 == 0) sendFrame(NAMES);
  const float G = 9.80665, DEGREE = 0.0174533;
  snprintf(body, sizeof body, "D,%lu,%lu,%.2f,%.2f,%.2f,%.3f,%.3f,%.3f", now, sample++, ax * G, ay * G, az * G,
           gx * DEGREE, gy * DEGREE, gz * DEGREE);
  sendFrame(body);
  if (sample % 4 == 0) sendWaiting();
}
