//! What was found, as `docs/diagnosis.md`: one page for users, written whole by one run on one commit.

use super::alarms::{self, BY_CHECK, COUNTS, FALSE, UNLABELLED, UNLABELLED_BY_CHECK};
use super::by_hand::{self, BY_HAND, EACH_BY_HAND};
use super::faults::{self, BY_CLASS, EACH, FOUND};
use super::judged::Judged;
use super::options::Known;
use super::rates::hours;
use super::summary;
use super::table::Form;

/// What stands before the tables.
pub(super) const HEAD: &str = "\
# Diagnosis: what the box finds, how fast, and how often it is wrong

`cargo xtask prove diagnosis` judges recorded flights whose faults are known, with the monitor of the board (as `hums check`
does, with default limits), and prints these tables; with `--write` it writes this page. `cargo xtask test` judges the
flights of the repository and fails when fewer faults are found or more false alarms come than before.

* `cargo xtask prove diagnosis FOLDER` judges the flights of a folder too: those of every `labels.json` in and below it, or, where
  there is none, all recordings as flights of which nothing is known. `--unseen FOLDER` is for flights that nobody
  who chose the limits had seen. `HUMS_FLIGHTS` names a folder of further recordings.
* [labels.json](../tests/labelled/README.md) says what was done to a flight and when. No label and none of these flights enters the
  code of a check. Which checks name the cause of which class of fault is a table of the judge's own
  (`tests/src/prove/diagnosis/causes.rs`).
* A figure is as good as its flights. Those marked \"known\" were known to whoever chose the limits: they show that nothing got
  worse. The figures that count are those of flights that were not, and of real recordings.
";

/// What no table shows.
const CANNOT: &str = "\
* A simulator has no loose screws, no worn bearings, no water and no wrong propeller. A fault there begins at once and is the only
  one. What the box finds on real vehicles is not known from these flights.
* What has no message cannot be found. PX4 sends texts (STATUSTEXT) only where a ground station is on the link. ArduPilot's
  simulator has ESC speeds that follow the command, so a weak motor hardly shows, and a barometer without noise.
* What is compared with earlier flights (wear, trends) is judged only where the labels name earlier flights (`past`): otherwise each recording is one flight of a
  vehicle that the box has not seen before. What came of 30 real flights with cut propellers stands in [usage.md](usage.md#baselines).
* What a check reads must be on the autopilot's port at the rate that the box asks for. Logs of ground stations have less.

Flown for this page after the limits were frozen, judged once when they were new, and known since: `frozen-3` at 24a2872, 41.06 hours: 24 false
warnings, 6 false criticals (0.15 an hour), four of them `motor_loss` of VTOLs on their wings; `frozen-4` at 30f3dc3, 19.98 hours: 22 false
warnings, 16 of them missing terrain data, and 5 false criticals, two of which were crashes: the truth knew one crash of a recording;
`frozen-5` at 7140a18, 29.12 hours: 14 false warnings (0.48 an hour, at most 0.75), no false critical (at most 0.10 an hour), 20 of 28 faults told, the
cause of 7 named, half within 2.1 s. The checks and the truth were mended after each. The alerts of the autopilot (`_alert`) were made with all of
these flights in sight: no set here is new to them, and the next one has to be flown.

`JUDGE` (73 flights of ArduPilot's and PX4's simulators, other seeds, frames, gains and winds, faults of random size) was judged once when it was new, at
df5dde0: in 3.85 hours 68 warnings and 5 criticals while nothing was wrong by its labels, 29 of 39 faults told, the cause of 28 named, half within 1.4 s. It is known
since. What these alarms were, by the data, looked at one by one by who changes the checks: of ArduPilot's 36 warnings in 3.61 hours **2 are false** (0.55
an hour, at most 1.74): an estimator that changed its sensors at a touch-down, and a receiver that stood still after one. 22 are `ekf_compass`, in flights whose labels do not
say that motors' currents were put on the compass: the field there is a tenth to 1.6 times larger or smaller with the motors than without, and ArduPilot's own ratio is
above its makers' 0.8; a debounce of 1 s (it is 0.5) would have spared one, which lasted so long. 12, and the only critical, are of two planes whose gains let them swing
in pitch with 6 g until the accelerometer clipped. Of PX4's 32 warnings and 4 criticals in 0.23 hours 10 are PX4's own word that its accelerometer timed out, which the
simulator made it say by giving no samples; 8, and 3 of the criticals, are of the last 20 seconds of a vehicle that crashed without a fault of the labels: no rate can be had of them.
Of the 10 faults that were not told, an aileron that stood off by 40 us and an elevator by 50 us were trimmed away, a twist turned the vehicle by
4 degrees at 17 degrees a second, and a receiver that is half a second late tells nothing that shows it.

`SITL-21` (166 flights of ArduPilot 4.7.0-dev, its simulator built from public source of December 2025 without CAN and so without ESC telemetry; our own, not in the
repository): quads of three sizes, hexacopters, octocopters of 3 and 32 kg, Y6, tricopters, planes, helicopters; modes GUIDED, LOITER, POSHOLD, ALT_HOLD, SPORT, CIRCLE, AUTO with random sticks and
legs; wind to 12 m/s with gusts; two barometers and gyros with noise of their own, 10 to 19 satellites; faults of random size 35 to 75 s after take-off, at the moment of the parameter's echo; the
streams that the box asks for, at its rates, with the autopilot's time. Split before anybody looked: on half A the checks were mended, B was judged with and without the mends,
C was flown after. Faults of B and C: 60 of 71 told (85 %, at least 76 %), the cause of 53 named (75 %, at least 65 %), half within 1.2 and 1.8 s. In 5.78 hours in the air 5 warnings
(0.87 an hour, at most 1.82) and no critical (at most 0.52 an hour); of the 5 one is false by the data (`roll_rate` of a quad flown in hard turns): the others are a pack that the
autopilot calls empty, a plane with 56 m/s2 of vibration in its messages, and one that pulled 4.9 g. Half A, before: 14 criticals in 1.90 hours, 12 of them false (a quad at 36 m/s that \"lay over\" by its drag,
banks of 60 degrees that the pilot held at full throttle); after: none of these. B and the labelled flights lost nothing. Not told in B and C: an octocopter's or Y6's weak motor (their outputs are not judged), a heading turned by an anomaly of 300 to 350 mG (the estimator's
ratio stays below 0.65), GPS velocity wrong by 2.5 m/s (0.69), noise of a gyro (two), vibration that rises from 1 to 18 and 24 m/s2 on an octocopter on fast legs and on a helicopter
(`vibration_rise` is judged where multicopters hover) and from 4.0 to 4.7, a twist of 40 degrees a second, position messages that stop (the box asks for them again; a recording cannot), an
aileron with 30 % of its way. Told without its cause: GPS height off by 17 to 23 m is `baro_height`, which does not say which of the two is wrong; biases of gyro and accelerometer of which the autopilot
has changed its estimator first (`ekf_alert`).
After that `gps_height`, `position_silent`, the vector of `gps_speed` and the comparisons outside of a hover were made with A, B and C in sight: of 116 faults there 103 are told (89 %; 98 before), the
cause of 99 is named (85 %; 86 before), half within 1.0 to 1.4 s (1.1 to 1.8). `D` (115 flights, flown with the same simulator and other random numbers, frames, coaxial octocopters among them, and winds to 9 m/s; judged
once, at commit 4c5b11a): of 100 faults **89 told (89 %, at least 82 %; 86 before), the cause of 86 named (86 %, at least 79 %; 76 before), half within 1.3 s**. In 3.85 hours in the air there 10 warnings and 7 criticals, of
which 9 and 7 are of one octocopter of 32 kg in SPORT that lost control without a label, turned over and fell; the other is a quad's `roll_rate` in hard turns (one in 3.7 hours). Not told in D: two weak motors of octocopters, two
anomalies of 430 and 490 mG, two twists, GPS velocity with an error that is random anew with each message (SIM_GPS1_VERR is noise, not an offset: two, and one without its cause), vibration of 6 m/s2 (two), noise of a gyro. With D in sight too `motor_output` of eight motors, `compass_heading`, gyros from 0.1 rad/s on and
vibration from a rise by 2.5 m/s2 on were made: D 95 told and the cause of 92 named, A, B and C 107 of 116 told, the cause of 103 named (no geometry of a frame is asked for); false alarms as before or
fewer, the labelled flights as before. `E` (33 flights of the same simulator with other random numbers, flown while the last change was built, in random order until the machine had no time for more; judged once): of 31 faults **29 told (94 %, at least 81 %), the cause of 28 named
(90 %, at least 77 %), half within 1.4 s; no false alarm in 0.86 hours in the air** (at most 3.5 an hour; less than the hour that was wanted, and than 40 faults). Not told there: vibration of 6 m/s2, and GPS velocity with noise. Tried and left out: a limit for the noise of a receiver's velocity against its
positions (told three more of D, and falsely in many healthy flights: turns of planes, late filters), accelerometers against each other on wings (9 false warnings in 4 flights), and a debounce that is shorter the further a value is beyond its limit (all checks; false `load_factor`, `gps_hdop` and `gps_jamming`, and the median
stayed: it is in the rates of the messages and the autopilot's own time). Y6 has no such pattern as a ring: two motors of an arm are as one to roll and pitch.
Shocks at landings were looked at for a limit: 377 ends of flights of public logs, 175 above 3 g, nine in ten below 9.2 g and 19 in 20 below 11.9 g, landings with nothing else wrong up to 12 g at the sensors' full rate. No limit parts them, and none was made.

Then the box asked for what decides five times a second and more ([companion.md](companion.md)), and checks of values that are smoothed already, or that a receiver says itself, were made to wait less, with A to E in sight, with `H` (21 flights at the new rates, the last of E's plan) and with 475
recordings, most of real flights, on which each change was tried: `motor_output` came in four real ones more and went in two, `gps_satellites` and `gps_accuracy` came in two more each (by the receiver's own word), `gyro_mismatch` went in one. Tried and left out, because real recordings had more of
it: `thrust_lost` after 1.5 s (in seven), `vibration` after 0.5 s (in six), accelerometers smoothed over a quarter of a second or told after 0.2 s (in four), the estimator's ratios and `ekf_climb` after 0.3 s (in one each), `motor_output` after 0.3 s as it was (in five); and `_stuck` after 0.6 s (four false in A to D). The labelled flights keep their old rates.
`F` (52 flights of the same simulator with other random numbers, frames (with outputs numbered in other ways), winds to 10 m/s and moments, at the new rates; flown while these changes were made, because the machine had the time then, and seen by nobody before they were judged once, at 1939d40; eight more never took off and are not
in it): of 49 faults **46 told (94 %, at least 85 %), the cause of 46 named (94 %, at least 85 %), half within 1.0 s (1.2 with the checks before, on the same flights; 1.4 in E at the old rates), nine in ten within 4.7 s**. In 1.12 hours in the air 5 warnings and 2 criticals: **4.5 an hour, which is more than the 1 that is wanted**. By the data 3 of them are false, of one event: three compasses without
noise that repeat their values while a quad hovers and yaws by 2 degrees (`compass_stuck`; the checks before say the same). The other 2 and both criticals are of one octocopter whose simulator has other directions of its motors than its parameters: four of its motors stand at idle and four at their end all the flight. Not told: a twist that leans a hexacopter by 10 degrees for a second as
gusts do, noise of a gyro (its messages have it filtered: 0.03 rad/s from message to message, half of what turns make), and noise of the receiver's velocity.
F is known since: where all compasses repeat their values at once, the vehicle must have turned ten times as far as where another one took a new value meanwhile, and `compass_stuck` waits 0.3 s (two compasses took a value 0.1 s before the first one's message did). The three false warnings of F are gone;
no told fault, cause, delay or other alarm changed in any set. `I` (6 healthy flights of the same simulator, other random numbers, at the new rates: 3 quads, 2 hexacopters, an octocopter with right directions; two missions, legs, POSHOLD, LOITER, slow moves; winds of 0.9 to 7.9 m/s;
two are cut in the air, and no plane's turn came, because the machine had no time for more; judged once): **no false alarm in 0.42 hours in the air** (at most 7.1 an hour; the hour that was wanted was not reached). `J` (78 healthy flights flown by somebody else after the last change, judged once: 33 quads, 22 hexacopters, 11 octoquads with right directions, 12 planes; winds to 9.6 m/s): **1 false warning and no false critical in 8.42 hours in the air** (0.12 an hour, at most 0.56; criticals at most 0.36): `roll_rate` of an octoquad that was yawed by the stick at 87 degrees a second and lagged 37 degrees behind its wanted attitude, in whose frame ATTITUDE_TARGET has its rates.
J is known since. Those rates are now turned to the body's axes, ArduPilot is asked for AHRS2, which is held against the estimator that flies, and satellites and dilution are held against what is usual in the flight. These were made with all sets so far, with 475 recordings, most of real flights, and with
`L` (40 flights of the same simulator with AHRS2, flown for it: fast yaws, full sticks, satellites that go among its faults) in sight. Of the 388 known faults of the labelled flights and of A to J as many are told and named as before (368 and 357), one 0.1 s sooner; `roll_rate` is gone from three flights (two of C and D, one of J), and two alarms of an octocopter after it had
lost control are of other checks. L: 22 of 28 faults told (19 before), 2 false warnings in 1.27 hours (6 before).
* `ahrs2_tilt`, `ahrs2_height`, `ahrs2_position`. Between the two estimators healthy vehicles of L and K came to 22 degrees of tilt (a light quad with full sticks at 24 m/s; 10 and less where nobody did that), 1.2 m of height, 3.9 m of place and 42 degrees of heading; 22 logs of others, real ones among them, to 5 degrees, 3.5 m and
  2.6 m. None crosses its limit where nothing was wrong. In the 475 recordings `ahrs2_tilt` comes in two: a receiver that leapt by 100 m, before the fall, and a vehicle that had crashed. They found nothing alone that no other check found: they are a second witness, for one receiver that jumps (1.0 s) and for a barometer without
  another one. Tried and left out: without an exact receiver (in eight real flights DCM lay over by 50 degrees without satellites, and was the one that was wrong), for VTOLs (other axes), with the receiver's own place for the first one's (logs before 2015), headings, and limits for tilt that would find a gyro's offset (17 degrees).
* `gps_sats_fall`, `gps_hdop_rise`. In 51 logs of others that tell of a receiver in flight 50 lost up to 18 % of their usual satellites for half a second, and had up to 1.3 times their usual dilution (one 1.7, above `gps_hdop`'s limit); the other one lost 33 % with 2.7 times, and its autopilot called that a glitch. Of the 475 recordings they come in three: that one, one that was jammed by its receiver's word, and a simulator's in which
  somebody had set the satellites to 2.
`K` (42 flights of the same simulator, other random numbers, frames, winds to 9.5 m/s and moments, flown after that and judged once with the checks frozen): **26 of 26 faults told (100 %, at least 89 %), the cause of 26 named (at least 89 %), half within 1.1 s, nine in ten within 2.0 s; no false alarm in 1.84 hours in the air** (at most 1.6 an hour). The checks before tell 18
of them on the same flights, and have 3 false warnings (an octoquad yawed by the stick). 13 of the faults are of GPS, 8 of them satellites or dilution (its field rewritten in the message) that get worse while the receiver calls itself exact; the others one or two each of motors, pack, compass, barometer, gyro, accelerometer, vibration, a kill switch and the radio. Twists, noise of a gyro and of a receiver's velocity, which are not found,
were not flown in K: of F's kinds 94 % stays the figure. 16 flights are healthy, six of these fast yaws and full sticks. `M` (4 more healthy
flights, as many as the machine had time for; judged once): no false alarm in 0.43 hours. K and M are 2.27 hours by the checks as they are without a false alarm (at most 1.3 an hour); the 20 hours that would bound criticals at 1 in 20 were not flown with these (J's 8.42 hours were, with the checks before).
After that one rule changed: an attitude that is held where it is wanted stays a wanted one. `N` showed it (136 healthy flights of the same simulator, flown by somebody else who changed no check till then, judged once by the checks of K: 58 quads, 38 hexacopters, 20 octoquads with right directions, 20 planes; winds to 10 m/s): without four flights in
SPORT by random sticks, two of which went out of control (114 degrees of roll; 22 g), 1 false warning (`gyro_mismatch`) and, of two flights of a light quad that flew straight on at 29 m/s and 66 degrees as it was told, 2 false warnings and 3 false criticals in 18.4 hours armed. Now those five alarms are gone, no told fault, cause, delay or other
alarm of A to F and H has changed, and N is known. Flown with the rule and judged once: `P`, 53 healthy flights (22 quads, 15 hexacopters, 8 octoquads, 8 planes): **3 false warnings (`load_factor`, of two flights) and no false critical in 7.77 hours in the air** (0.39 an hour, at most 1.0; criticals at most 0.39). `O`, 73 flights with one fault each, kinds of F in random order, frames, winds and moments,
as many as the machine had time for: **63 of 73 told (86 %, at least 78 %), the cause of 61 named (84 %), half within 1.0 s, nine in ten within 9.4 s; no false alarm in 1.17 hours**. Not told: two twists, two wrong GPS velocities, two magnetic anomalies of 330 and 360 mG 60 m high, a noisy gyro, two barometers that froze at once, an aileron's servo at 30 % of its way, vibration that
rose to 6 m/s2. F, K and O together: 135 of 148 (91 %), which is less than the 95 % that are wanted. No false critical in 11.2 hours that nobody had seen (K, M, O, P: at most 0.27 an hour).
`Q` (126 flights with one fault each; frames, masses, gains, packs, winds to 10 m/s, 10 to 19 satellites, moments and sizes of faults at random; 56 kinds) and `R` (102 healthy flights: 24
planes and more, Y6 and octoquads among the others) were flown by somebody who changed no check and did not look at what these say, and judged once by the checks of O and P: **117 of 126 told (93 %, at least 88 %), the cause of 114 named (90 %, at least 85 %), half of them within 1.1 s, nine in ten within 10.7 s.** (`prove diagnosis` says 3.4 s of
these files: in 59 of them the time before the arming is 2.6 to 3.0 s longer by the autopilot's clock than by the one that their labels go by; that difference is taken off here, file by file.) Not told: two twists, two noisy gyros, two pairs of barometers that froze, an elevator at 28 % of its way, all motors at 58 % for the last metres to the
ground, a plane's vibration of 11 m/s2 (vibration is judged on rotors). In 18.85 hours in the air nothing else was wrong by the labels, and there were 7 warnings (0.37 an hour, at most 0.70) and 6 criticals: **12 of these 13 are of six flights in which ArduPilot itself ran into an internal error in the middle of a mission
(`Internal Errors 0x20000000`: an invalid argument) and called its state critical from then on, the 13th is its own `Potential Thrust Loss`. By the data none is false** (warnings and criticals each at most 0.16 an hour); by the labels alone the criticals are 0.32 an hour. F, K, O and Q together: 252 of 274 told (92 %, at least 89 %): less
than the 95 % that are wanted. With K, M, O and P no critical was false by the data in 30.0 hours that nobody had seen (at most 0.10 an hour), and 3 warnings were (`load_factor`: 0.10 an hour, at most 0.26).
`S` (49 flights of PX4's simulator with one fault each, 48 of which the messages show; quads, hexas, planes, wind, 45 kinds) and `T` (20 healthy ones) were flown in the same way and judged once by the checks as they were then: **45 of 48 told (94 %, at least
85 %), the cause of 41 named (85 %, at least 74 %), half of them within 1.0 s, nine in ten within 6.7 s; no critical in 3.47 hours in the air, and 23 false warnings, all of one check**: `compass_unused` told each pause that PX4 makes in the use of a sound compass. It now asks for
a heading that moved away too: no warning is left in the 2.74 healthy hours, every compass fault of `S` is told as before, and three of the labelled ones 1.5 to 2 s later. Not told: a pack that drops by 1.4 V, a plane's propeller at 65 % and its ailerons at a third. With F, K, O and Q: 297 of 322 (92 %, at least 89 %). No critical false by
the data in 33.5 hours that nobody had seen (at most 0.09 an hour).
`U` (43 flights of ArduPilot's simulator and 23 of PX4's with one fault each, every second one violent: dead sensors, kills, dead barometers, falls) and `V` (20 healthy ones of ArduPilot's: gusts, hard and fast landings, fast descents, soft tip-overs) were flown by somebody who changed no check, and judged once:
**60 of 66 told (91 %, at least 83 %), the cause of 53 named (80 %, at least 71 %), half of them within 1.6 s, nine in ten within 9.1 s; no false warning and no critical in 2.90 hours in the air.** Not told: an aileron at 25 % and an elevator at 34 % of their way, a plane's GPS velocity that is wrong by 3 m/s, motors of two hexas at 83 and 86 %,
and a twist that leaned a quad by 13 degrees. Not named: accelerometers that are biased alike and gyros that are biased (told as the EKF or a compass). With F, K, O, Q and S: 357 of 388 (92 %, at least 89 %). No critical false by the data in 36.4 hours (at most 0.09 an hour).
After that `imu_gps` was made, with all sets so far in sight: the force of the first accelerometer, turned by the attitude, less gravity, against the change of the receiver's velocity, smoothed over 1.5 s. By a model of it in Python (`firmware/core/src/imu_gnss.rs` is the same rule) the
greatest residual of 54 healthy flights on rotors is 0.8 m/s2 and of 16 of planes 1.1, in fast turns 1.6 and 1.5, where it is not judged; none comes to the limit of 1.5. Of the labelled flights and those of U it comes in 10, all of them with a fault of an inertial sensor: biased accelerometers (5) after 0.8 to 5.2 s, constant ones (3) after 1.2 to 3.7 s, and PX4's biased gyros (2) after 2.7 s,
whose attitude leans further and further. Not found: a plane's first accelerometer with 1.6 m/s2, which steps too much, gyros about the vertical axis (the copter turns fast by then, and is not judged), one with 0.14 rad/s of which the autopilot changed its estimator in time. Tried: the velocity as it comes (residuals of healthy copters to 1.2 at 2 and at 5 Hz), later by the whole time between two (1.5 at 2 Hz), and by half
of it (1.2 and 0.9, taken); in fast turns too (copters 2.1, planes 2.6); with the climb on wings (2.2 at flares). The mean rate of a gyro less that of the attitude over 2 s is up to 0.12 rad/s where nothing is wrong, and 0.22 in one flight; it finds ArduPilot's biased gyros of 0.14 rad/s and more within 3 s, which `gyro_mismatch` does too where there are two, and none of PX4's, whose attitude follows its gyro: left out.
Then `gyro_noise` was made (VIBRATION's gyro metric of PX4: 0.01 to 0.12 rad/s in healthy flights, 0.67 and 0.99 with gyros that were made noisy), with all sets in sight. By the monitor the sets K, O, Q (93 faults), S (48), U and V (66) with both checks: 193 of 207 told (93 %), the cause of 188 named (91 %; 183 before), half within 1.0 s; no new alarm in
the 22 healthy hours of all sets. (The labels of 50 of the ArduPilot files of these sets go by a clock that loses 3 s before the arming; that is taken off since.) These sets are known to whoever made the checks. `W` (35 faults of ArduPilot's simulator, 18 healthy flights) and `X` (44 faults of PX4's) are not: they were flown by the program of U and V with a new
random number, unattended, and judged once: **72 of 79 told (91 %, at least 84 %), the cause of 67 named (85 %, at least 77 %; 64 by the checks before), half of them within 0.6 s, nine in ten within 5.0 s; in 2.90 hours in the air 4 warnings and 1 critical, none false by the data**: ArduPilot's own `Potential Thrust Loss` twice, 52 m/s2 of vibration with clipped accelerometers of a
plane in turbulence, and a touch at 2.4 m/s and 4.1 g, which is told as an impact (limit 3 g). Not told: accelerometers biased by 1.5 m/s2, an aileron that stands off, a twist of 0.4 s, a pack's resistance and a drop of 1.5 V, a barometer that repeats one value, a motor that was switched off. Not named: accelerometers that are biased sideways in a plane or slowly learnt by the
estimator, gyros that are biased alike, a receiver that is late. (The simulator's own truth was not kept in these; the moment of a fault is the autopilot's echo of its parameter, in 11 more files it is not known, and they are left out.) With F, K, O, Q, S, U: 429 of 467 told (92 %, at least 89 %). No critical was false by the data in 39.3 hours that nobody had seen (at most 0.08 an hour).
Then `imu_gps` was smoothed over 1.0 s instead of 1.5, what a receiver that is late by up to 0.6 s makes of a force that changes was taken off, and what a receiver repeats was left out; the limit went from 1.5 to 1.0 m/s2. By a model in Python the greatest residual of 62 healthy flights of simulators is 0.4 m/s2 (0.6 by the rule before), and 1.8 of a real one that shakes with 35 to
75 m/s2, where the monitor tells nothing. By the monitor, of 364 faults of the sets K to X and of the labelled ones (without those of links): receivers that were late by 0.8 s and that repeated a position are not told as `imu_gps` any more (3), a late one of 0.9 s is; a biased accelerometer more is told, others are told 0.1 to 2.6 s sooner (11) or later (7, one of them by 6 s). `baro_stuck` tells
barometers that fell silent in a hover after 10 s (4 flights, 3 of which were not told at all). Told 342 (339 before), the cause of 328 named (325), no new alarm in healthy flights. Tried and left out: the compass's turning less the first gyro's, smoothed over 1 s, less 0.3 of what turns: 0.24 rad/s where nothing is wrong, and compasses that were stuck or turned
look like gyros; steps of GPS velocity that no force explains: to 1.3 m/s in healthy flights, two receivers with wrong velocities are at 2.
Then sensors of one kind were compared sample by sample, of one moment, motors' outputs as parts of their range, and mishaps as `health.md` has them. `UA` (56 faults of ArduPilot 4.7-dev's simulator, 16 healthy flights) and `UP` (58 faults of PX4 1.18-dev's, 15 healthy ones) were flown by somebody who changed no
check, with seeds from the system and the simulator's truth kept, and judged once: **107 of 114 told (94 %, at least 89 %), the cause of 102 named (89 %, at least 84 %), half of them within 1.2 s, nine in ten within 7.2 s; in 2.34 hours in the air 9 warnings and no critical**: 5 times `esc_silent` of planes whose throttle was closed at the touch (5 criticals of it on the ground), 3 times `thrust_lost` of
planes that come down at 0.5 m/s with 96 % throttle, once `vibration`. Not told: a position of GPS that drifts by 1 m/s while its velocity does not (2), one gyro of several that is noisy (2), an accelerometer's bias of 0.6 m/s2, and a motor of 75 and of 60 % in wind of 9 m/s, in which the simulator's quadrotor leans by 25 to 45 degrees. With the planes' ESCs left out without
throttle, and a motor that is alone at its end told whatever the tilt, which these sets showed: 108 told, 4 warnings. All unseen sets together, as first judged: 624 of 680 told (92 %); no critical was false by the data in 44.6 hours.

What the delay is made of, by the check that told first: how many and within what median of seconds in A to E with the checks before, in A to E with those of now, and in F and H at the new rates; and what it waits for.

* ekf_alert: 28 in 0.8; 26 in 0.6; 4 in 0.9. The autopilot changes its estimator and says so; told within 0.1 s of that.
* gps_height: 15 in 1.0; 15 in 1.0; 3 in 0.4. Two messages of the receiver.
* gps_fix: 12 in 1.0; 12 in 1.0; 6 in 0.6. Two messages of the receiver; the autopilot notes after some tenths.
* compass_heading: 10 in 1.5; 14 in 0.9; 7 in 0.7. 0.5 s of smoothing, 0.2 s beyond the limit.
* motor_output: 12 in 4.2; 13 in 2.6; 4 in 1.2. 2 s of smoothing, 0.5 s beyond the limit; a small loss is summed for longer.
* compass_alert, baro_alert, accel_alert, gyro_alert, battery_alert: 26 in 0.9; 26 in 0.9; 5 in 0.3. The autopilot's own time (0.5 s of a compass), two messages.
* rc_alert: 10 in 1.0; 10 in 1.0; 5 in 1.0. ArduPilot waits 1 s for a pulse, then says so.
* ekf_compass, ekf_variance: 23 in 0.9; 17 in 0.9; 2 in 0.9. 0.5 s above the limit.
* vibration_rise: 6 in 1.6; 7 in 1.4; 2 in 0.8. Two messages, a quarter of a second of smoothing, 0.2 s above.
* gps_satellites, gps_accuracy: 6 in 2.6; 6 in 1.2; 1 in 1.3. 0.6 s beyond the limit.
* accel_mismatch: 5 in 2.4; 5 in 2.4; 1 in 2.7. A second of smoothing, 0.5 s beyond the limit: motors shake accelerometers.
* baro_noise: 3 in 1.8; 3 in 1.8; 2 in 0.8. Some messages, 0.5 s beyond the limit.
* disarmed_in_air: 6 in 1.2; 6 in 1.2; -. The heartbeat, one a second, and then a fall of 0.2 s.
* heartbeat, position_silent, frames_lost: 15 in 3.3; 15 in 3.3; 5 in 3.6. 3.5 s and 3 s of age; a share of frames.
* gcs_alert: 5 in 5.0; 5 in 5.0; 1 in 4.7. The autopilot's own 5 s.
* cell_voltage: 9 in 40; 9 in 40; 3 in 5.5. 5 s below the limit, which a load's sag does not last; a pack that runs empty.
* baro_height, of drifts: 8 in 14; 8 in 14; 2 in 11. 8 m at 0.4 to 1.5 m/s.

Of the 46 in F 17 are of kinds that cannot be told within a second: what the autopilot itself waits for (radio 1 s, ground station 5 s), ages of links, a pack's sag, drifts, full throttle that must last, sensors that stand still until the vehicle has moved, control that hides a weak motor at first.

What readers found who had not seen the checks, in recordings of real vehicles that were not used to build them, judged by hand:

* At commit d9bdda6, 41 recordings, 1.5 h in the air, mostly multicopters, 2014 to 2025: 7 false warnings and 7 false criticals, most of
  them banks flown in ACRO and `motor_imbalance` of a vehicle that turned fast or stood; and 69 alarms of a gyro with an offset on the
  bench. Of 11 crashes 7 were told as a mishap. The checks were changed after it.
* At commit 5569e89, after that change, 88 recordings, 1.6 h in the air (a quarter of an hour of it is not true: the autopilot called a vehicle
  that stood \"not landed\"); 64 are flight, crash and bench tests of one fleet of multicopters, 2014 to 2016; one flight of a plane, no VTOL.
  Warnings: 30 true, 1 false. Criticals: 72 true, 2 not known, **19 false**. 17 of these are of six logs of one day in which a gyro with an
  offset of 7 degrees a second turned the autopilot's own attitude over while the vehicle stood; the other two, 1.5 an hour, are a descent that an
  estimator claimed (`sinking`, `disarmed_in_air`). Of 20 crashes and tip-overs 16 were told by a critical finding of their own; missed were two flips at
  take-off of a vehicle that the autopilot never called flying. Of some 85 flights 74 were counted right. The checks were changed after it; by
  who changed them, 5 or 6 of the 19 remain: three descents of one vehicle whose estimator fell, and three of one on a test stand.
* At commit ea3e47e, 100 recordings of 42 owners, 37 armed, 0.39 h in the air, all multicopters: of 25 criticals 23 true, 1 false (an empty battery's
  level on the bench, by USB), 1 not known (a sag, without a measured current); of 22 warnings 20 true, 2 false (`radio_margin` of radios
  that say 0). Of 7 crashes 5 were told; missed were a third flip of one evening, which is told since, and a fall of a log that does not
  say what vehicle it is of. One flight of 18 was none: a standing vehicle whose autopilot called it flying.

These faults were not told:
";

const SETS: Form = Form {
    title: "On which data",
    about: "Hours are simulated time for flights of a simulator. \"Known\" says whether whoever chose the limits knew the flights.",
    columns: &[
        "flights",
        "recordings",
        "with a fault",
        "hours recorded",
        "hours in the air without a fault",
        "labels",
        "known",
    ],
};

const NOT_SEEN: &str = "## What it cannot see";

fn sets(sets: &[Judged]) -> Vec<Vec<String>> {
    let row = |judged: &Judged| {
        let sum = |of: fn(&super::outcome::Outcome) -> f64| judged.outcomes.iter().map(of).sum::<f64>();
        let faults = judged.outcomes.iter().filter(|one| one.fault.is_some()).count();
        let known = match judged.known {
            Known::Yes => "known, used for tuning",
            Known::No => "not known",
            Known::Seen => "findings seen, no limit fitted to them",
        };
        vec![
            judged.name.clone(),
            judged.outcomes.len().to_string(),
            faults.to_string(),
            hours(sum(|one| one.recorded_s)),
            hours(sum(|one| one.air_s)),
            if judged.is_labelled { "yes" } else { "none" }.to_owned(),
            known.to_owned(),
        ]
    };
    sets.iter().map(row).collect()
}

/// The sections, in order.
pub(super) fn text(judged: &[Judged]) -> String {
    let missed = faults::missed(judged);
    let missed = if missed.is_empty() { vec!["* none of those above".to_owned()] } else { missed };
    let mut counts = COUNTS.section(&alarms::counts(judged));
    let wrong = alarms::wrong_counts(judged);
    if !wrong.is_empty() {
        counts = format!("{counts}\nWrong are:\n\n{}\n", wrong.join("\n"));
    }
    [
        summary::section(judged),
        SETS.section(&sets(judged)),
        FOUND.section(&faults::found(judged)),
        BY_CLASS.section(&faults::by_class(judged)),
        FALSE.section(&alarms::by_vehicle(judged, true)),
        BY_CHECK.section(&alarms::by_check(judged, true)),
        UNLABELLED.section(&alarms::by_vehicle(judged, false)),
        UNLABELLED_BY_CHECK.section(&alarms::by_check(judged, false)),
        BY_HAND.section(&by_hand::rows(judged)),
        EACH_BY_HAND.section(&by_hand::each(judged)),
        counts,
        format!("{NOT_SEEN}\n\n{CANNOT}\n{}\n", missed.join("\n")),
        EACH.section(&faults::each(judged)),
    ]
    .join("\n")
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::flights::root;

    /// The lines that are the same in each run, in order.
    fn labels() -> Vec<String> {
        let form = |form: &Form| form.lines();
        let alarms = [&FALSE, &BY_CHECK, &UNLABELLED, &UNLABELLED_BY_CHECK, &BY_HAND, &EACH_BY_HAND];
        let forms = [&SETS, &FOUND, &BY_CLASS].into_iter().chain(alarms).chain([&COUNTS]);
        let mut labels = vec![summary::TITLE.to_owned()];
        labels.extend(forms.flat_map(form));
        labels.push(NOT_SEEN.to_owned());
        labels.extend(EACH.lines());
        labels
    }

    fn found(text: &str) -> Vec<String> {
        let lines: Vec<&str> = text.lines().collect();
        let is_label = |place: usize| {
            let next = lines.get(place + 1).is_some_and(|next| next.starts_with("|---"));
            lines[place].starts_with("## ") || next
        };
        (0..lines.len()).filter(|place| is_label(*place)).map(|place| lines[place].to_owned()).collect()
    }

    #[test]
    fn the_document_is_of_the_tables_that_the_judge_prints() {
        let text = fs::read_to_string(root().join("docs/diagnosis.md")).unwrap();
        assert!(
            text.starts_with(HEAD),
            "docs/diagnosis.md has another beginning: `cargo xtask prove diagnosis --write`"
        );
        assert_eq!(found(&text), labels(), "`cargo xtask prove diagnosis --write` writes docs/diagnosis.md");
        assert!(text.contains(CANNOT), "what it cannot see");
        assert_eq!(text.lines().filter(|line| line.starts_with("Commit ")).count(), 1, "one commit");
    }
}
