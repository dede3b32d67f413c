//! Property numbers per puck type and firmware generation, as data.
//!
//! One entry per property: Barrett's mnemonic, the width of its replies, and per list the firmware versions at which
//! its number changed. Lists of motors begin with [`OLDEST_MOTOR_FIRMWARE`](super::OLDEST_MOTOR_FIRMWARE). Source: the
//! manufacturer's property list; the test `every_property_number_equals_the_vectors` compares every cell. Mnemonics
//! that share a number (AP with P, TORQ with T, B with FET0, TENSION with FET1) appear once.

use super::{ABSENT, NOWHERE, Row};

properties! {
    /// A: acceleration of the force/torque sensor.
    A "A" short { motor: [(114, 104), (119, ABSENT)], force_torque: [(0, 64)] }
    /// ACCEL: acceleration of trapezoidal moves.
    Accel "ACCEL" short {
        safety: [(0, 69), (33, 71), (36, 69), (61, ABSENT)],
        motor: [(61, 79), (65, 82)]
    }
    /// ADDR: address to peek or poke.
    Addr "ADDR" short { monitor: [(0, 6)], safety: [(0, 6)], motor: [(61, 6)], force_torque: [(0, 6)] }
    /// ANA0: analogue input 0.
    Ana0 "ANA0" short { safety: [(0, 44), (61, 18)], motor: [(61, 18)], force_torque: [(0, 18)] }
    /// ANA1: analogue input 1.
    Ana1 "ANA1" short { safety: [(0, 45), (61, 19)], motor: [(61, 19)], force_torque: [(0, 19)] }
    /// AX: x acceleration of the force/torque sensor.
    Ax "AX" short { force_torque: [(0, 55)] }
    /// AY: y acceleration of the force/torque sensor.
    Ay "AY" short { force_torque: [(0, 56)] }
    /// AZ: z acceleration of the force/torque sensor.
    Az "AZ" short { force_torque: [(0, 57)] }
    /// BAUD: bit rate of the bus.
    Baud "BAUD" short { safety: [(0, 38), (61, 12)], motor: [(61, 12)], force_torque: [(0, 12)] }
    /// CMD: hand command, see `HandCommand`.
    Cmd "CMD" short { safety: [(61, 29)], motor: [(61, 29)], force_torque: [(0, 29)] }
    /// CT: close target (counts), also a travel limit.
    Ct "CT" wide { safety: [(0, 36), (61, ABSENT)], motor: [(61, 56)] }
    /// CTS: encoder counts per motor revolution.
    Cts "CTS" wide { safety: [(0, 30), (61, ABSENT)], motor: [(61, 65), (64, 66), (65, 68)] }
    /// D: duty cycle (oldest firmware).
    D "D" short { safety: [(0, 9), (50, ABSENT)] }
    /// DEF: set the property named by the value to its default.
    Def "DEF" short {
        safety: [(0, 89), (33, 91), (36, 89), (61, 32)], motor: [(61, 32)],
        force_torque: [(0, 32)]
    }
    /// DIG0: digital line 0.
    Dig0 "DIG0" short { safety: [(0, 42), (61, 14)], motor: [(61, 14)], force_torque: [(0, 14)] }
    /// DIG1: digital line 1.
    Dig1 "DIG1" short { safety: [(0, 43), (61, 15)], motor: [(61, 15)], force_torque: [(0, 15)] }
    /// DP: default position (counts), target of the move command.
    Dp "DP" wide { safety: [(0, 32), (61, ABSENT)], motor: [(61, 50)] }
    /// DS: default step (counts).
    Ds "DS" short {
        safety: [(0, 59), (33, 61), (36, 59), (61, ABSENT)],
        motor: [(61, 70), (64, 58), (65, 60)]
    }
    /// DUMP: service.
    Dump "DUMP" short {
        safety: [(0, 74), (33, 76), (36, 74), (61, ABSENT)]
    }
    /// E: end point of a trapezoidal move (counts).
    E "E" wide { safety: [(0, 13), (47, 14), (61, ABSENT)], motor: [(61, 52)] }
    /// ECMAX: largest index-pulse position seen.
    Ecmax "ECMAX" short {
        safety: [(44, 113), (61, ABSENT)], motor: [(61, 91), (65, 96), (125, 100), (132, 101)]
    }
    /// ECMIN: smallest index-pulse position seen.
    Ecmin "ECMIN" short {
        safety: [(44, 114), (61, ABSENT)], motor: [(61, 92), (65, 97), (125, 101), (132, 102)]
    }
    /// EN: enable bits.
    En "EN" wide {
        safety: [(0, 63), (33, 65), (36, 63), (61, ABSENT)],
        motor: [(61, 74), (65, 77), (132, 94)]
    }
    /// ERROR: last error.
    Error "ERROR" short { monitor: [(0, 4)], safety: [(0, 4)], motor: [(61, 4)], force_torque: [(0, 4)] }
    /// FET0: open-drain output 0, also called B.
    Fet0 "FET0" short {
        safety: [(0, 14), (47, 13), (50, 11), (61, 16)], motor: [(61, 16)],
        force_torque: [(0, 16)]
    }
    /// FET1: open-drain output 1, also called TENSION.
    Fet1 "FET1" short {
        safety: [(0, 70), (33, 72), (36, 70), (61, 17)], motor: [(61, 17)],
        force_torque: [(0, 17)]
    }
    /// FIND: calibrate the property named by the value.
    Find "FIND" short { safety: [(45, 117), (61, 33)], motor: [(61, 33)], force_torque: [(0, 33)] }
    /// FT: GET: force and torque frames; SET 0: tare.
    Ft "FT" short { force_torque: [(0, 54)] }
    /// FX: x force alone.
    Fx "FX" short { force_torque: [(0, 48)] }
    /// FY: y force alone.
    Fy "FY" short { force_torque: [(0, 49)] }
    /// FZ: z force alone.
    Fz "FZ" short { force_torque: [(0, 50)] }
    /// GAIN1: service.
    Gain1 "GAIN1" short {
        safety: [(0, 79), (33, 81), (36, 79), (61, ABSENT)]
    }
    /// GAIN2: service.
    Gain2 "GAIN2" short {
        safety: [(0, 80), (33, 82), (36, 80), (61, ABSENT)]
    }
    /// GAIN3: service.
    Gain3 "GAIN3" short {
        safety: [(0, 81), (33, 83), (36, 81), (61, ABSENT)]
    }
    /// GM: gain matrix of the force/torque sensor: EEPROM, 1 s per value.
    Gm "GM" short { force_torque: [(0, 58)] }
    /// GRPA: first group of the puck.
    Grpa "GRPA" short { safety: [(0, 51), (61, 26)], motor: [(61, 26)], force_torque: [(0, 26)] }
    /// GRPB: second group of the puck.
    Grpb "GRPB" short { safety: [(0, 52), (61, 27)], motor: [(61, 27)], force_torque: [(0, 27)] }
    /// GRPC: third group of the puck.
    Grpc "GRPC" short { safety: [(0, 53), (61, 28)], motor: [(61, 28)], force_torque: [(0, 28)] }
    /// HALLH: history of the Hall sensors.
    Hallh "HALLH" wide {
        safety: [(44, 110), (61, ABSENT)], motor: [(61, 85), (64, 84), (65, 87), (68, 88)]
    }
    /// HALLS: state of the Hall sensors.
    Halls "HALLS" short {
        safety: [(44, 109), (61, ABSENT)], motor: [(61, 84), (64, 86), (65, 89), (68, 87)]
    }
    /// HOLD: 1: hold the position after a move; 0: go idle.
    Hold "HOLD" short { motor: [(65, 94), (132, 77)] }
    /// HSG: strain-gauge limit that stops a closing finger.
    Hsg "HSG" short {
        safety: [(0, 57), (33, 59), (36, 57), (61, ABSENT)],
        motor: [(61, 68), (64, 69), (65, 71)]
    }
    /// ID: node number.
    Id "ID" short { monitor: [(0, 3)], safety: [(0, 3)], motor: [(61, 3)], force_torque: [(0, 3)] }
    /// IFAULT: safety module: ignore the next n velocity faults.
    Ifault "IFAULT" short {
        safety: [(0, 100), (33, 102), (36, 100), (61, 55)]
    }
    /// IHIT: current limit while the hand initialises.
    Ihit "IHIT" short { motor: [(175, 108)] }
    /// IKCOR: current loop, correction gain.
    Ikcor "IKCOR" short {
        safety: [(0, 103), (33, 105), (36, 103), (61, ABSENT)],
        motor: [(61, 90), (65, 93)]
    }
    /// IKI: current loop, integral gain.
    Iki "IKI" short {
        safety: [(0, 102), (33, 104), (36, 102), (61, ABSENT)],
        motor: [(61, 89), (65, 92)]
    }
    /// IKP: current loop, proportional gain.
    Ikp "IKP" short {
        safety: [(0, 101), (33, 103), (36, 101), (61, ABSENT)],
        motor: [(61, 88), (65, 91)]
    }
    /// ILOGIC: logic current.
    Ilogic "ILOGIC" short { safety: [(0, 50), (61, 24)], motor: [(61, 24)], force_torque: [(0, 24)] }
    /// IMOTOR: motor current.
    Imotor "IMOTOR" short { safety: [(0, 48), (61, 22)], motor: [(61, 22)], force_torque: [(0, 22)] }
    /// IOFF: offset used while the hand initialises.
    Ioff "IOFF" wide {
        safety: [(0, 61), (33, 63), (36, 61), (61, ABSENT)],
        motor: [(61, 72), (65, 74)]
    }
    /// IOFST: zero of the current sensor: never write.
    Iofst "IOFST" short { safety: [(0, 21), (61, ABSENT)], motor: [(61, 59), (64, 60), (65, 62)] }
    /// IPNM: current units per N m at the motor.
    Ipnm "IPNM" short {
        safety: [(33, 57), (36, 108), (61, ABSENT)], motor: [(61, 83), (65, 86)]
    }
    /// ISQ: current squared.
    Isq "ISQ" short { safety: [(45, 115), (61, ABSENT)] }
    /// ITOR: torque limit while the hand initialises (VERS 168..174).
    Itor "ITOR" short { motor: [(168, 108), (175, ABSENT)] }
    /// IVEL: speed used while the hand initialises.
    Ivel "IVEL" short {
        safety: [(0, 60), (33, 62), (36, 60), (61, ABSENT)],
        motor: [(61, 71), (65, 73)]
    }
    /// JIDX: index of the joint.
    Jidx "JIDX" short {
        safety: [(33, 55), (36, 107), (61, ABSENT)], motor: [(61, 82), (65, 85)]
    }
    /// JOFST: offset of the secondary encoder (counts).
    Jofst "JOFST" wide { motor: [(125, 98)] }
    /// JP: position of the secondary encoder (counts).
    Jp "JP" wide { motor: [(125, 96)] }
    /// KD: position loop, derivative gain.
    Kd "KD" short {
        safety: [(0, 66), (33, 68), (36, 66), (61, ABSENT)],
        motor: [(61, 77), (65, 80)]
    }
    /// KI: position loop, integral gain.
    Ki "KI" short {
        safety: [(0, 67), (33, 69), (36, 67), (61, ABSENT)],
        motor: [(61, 78), (65, 81)]
    }
    /// KP: position loop, proportional gain.
    Kp "KP" short {
        safety: [(0, 65), (33, 67), (36, 65), (61, ABSENT)],
        motor: [(61, 76), (65, 79)]
    }
    /// LCTC: life-cycle counter.
    Lctc "LCTC" short { motor: [(61, 95), (63, 94), (65, 99), (125, 103), (132, 104)] }
    /// LCV: life-cycle value.
    Lcv "LCV" short { safety: [(50, 118), (61, ABSENT)] }
    /// LCVC: life-cycle value counter.
    Lcvc "LCVC" short {
        safety: [(51, 119), (61, ABSENT)], motor: [(61, 94), (63, 95), (65, 100), (125, 104), (132, 105)]
    }
    /// LED: light of the force/torque sensor.
    Led "LED" short { force_torque: [(0, 60)] }
    /// LFAP: library service.
    Lfap "LFAP" short { safety: [(50, 121), (51, 122), (61, ABSENT)] }
    /// LFDP: library service.
    Lfdp "LFDP" short { safety: [(50, 122), (51, 123), (61, ABSENT)] }
    /// LFLAGS: library service.
    Lflags "LFLAGS" short { motor: [(61, 93), (65, 98), (125, 102), (132, 103)] }
    /// LFS: library service.
    Lfs "LFS" short { safety: [(50, 120), (51, 121), (61, ABSENT)] }
    /// LFT: library service.
    Lft "LFT" short { safety: [(50, 123), (51, 124), (61, ABSENT)] }
    /// LFV: library service.
    Lfv "LFV" short { safety: [(50, 119), (51, 120), (61, ABSENT)] }
    /// LOAD: load the property named by the value from EEPROM.
    Load "LOAD" short {
        monitor: [(0, 10)], safety: [(0, 88), (33, 90), (36, 88), (61, 31)],
        motor: [(61, 31)], force_torque: [(0, 31)]
    }
    /// LOCK: write protection.
    Lock "LOCK" short {
        monitor: [(0, 8)], safety: [(0, 41), (61, 13)], motor: [(61, 13)], force_torque: [(0, 13)]
    }
    /// LOG: service log.
    Log "LOG" short {
        safety: [(0, 73), (33, 75), (36, 73), (61, ABSENT)]
    }
    /// LOG1: service log.
    Log1 "LOG1" short {
        safety: [(0, 75), (33, 77), (36, 75), (61, ABSENT)]
    }
    /// LOG2: service log.
    Log2 "LOG2" short {
        safety: [(0, 76), (33, 78), (36, 76), (61, ABSENT)]
    }
    /// LOG3: service log.
    Log3 "LOG3" short {
        safety: [(0, 77), (33, 79), (36, 77), (61, ABSENT)]
    }
    /// LOG4: service log.
    Log4 "LOG4" short {
        safety: [(0, 78), (33, 80), (36, 78), (61, ABSENT)]
    }
    /// LSG: lower strain-gauge limit.
    Lsg "LSG" short {
        safety: [(0, 58), (33, 60), (36, 58), (61, ABSENT)],
        motor: [(61, 69), (64, 70), (65, 72)]
    }
    /// M: move to the position given (counts).
    M "M" wide { motor: [(61, 96), (65, 58)] }
    /// MAXPWR: power limit.
    Maxpwr "MAXPWR" short {
        safety: [(0, 98), (33, 100), (36, 98), (61, 54)]
    }
    /// MCV: largest closing velocity (counts/ms).
    Mcv "MCV" short { safety: [(0, 18), (61, ABSENT)], motor: [(61, 46)] }
    /// MD: largest duty (oldest firmware).
    Md "MD" short { safety: [(0, 15), (47, ABSENT)] }
    /// MDS: largest step.
    Mds "MDS" short { safety: [(0, 25), (61, ABSENT)], motor: [(61, 62), (64, 63), (65, 65)] }
    /// MECH: absolute mechanical angle (counts).
    Mech "MECH" wide { safety: [(0, 28), (61, ABSENT)], motor: [(61, 63), (64, 64), (65, 66)] }
    /// MODE: mode of the puck (`MotorMode`) or of the safety module (`SafetyMode`).
    Mode "MODE" short { safety: [(0, 8)], motor: [(61, 8)], force_torque: [(0, 8)] }
    /// MOFST: commutation offset: never write.
    Mofst "MOFST" short { safety: [(0, 20), (61, ABSENT)], motor: [(61, 58), (64, 59), (65, 61)] }
    /// MOV: largest opening velocity (counts/ms).
    Mov "MOV" short { safety: [(0, 19), (61, ABSENT)], motor: [(61, 47)] }
    /// MPE: largest position error.
    Mpe "MPE" short {
        safety: [(0, 62), (33, 64), (36, 62), (61, ABSENT)],
        motor: [(61, 73), (65, 76)]
    }
    /// MT: largest torque (current units); clips T.
    Mt "MT" short { safety: [(0, 16), (61, ABSENT)], motor: [(61, 43)] }
    /// MV: largest velocity of moves (counts/ms).
    Mv "MV" short { safety: [(0, 17), (61, ABSENT)], motor: [(61, 45)] }
    /// OD: odometer.
    Od "OD" short { safety: [(0, 24), (61, ABSENT)], motor: [(61, 61), (64, 62), (65, 64)] }
    /// OFFSET1: service.
    Offset1 "OFFSET1" short {
        safety: [(0, 82), (33, 84), (36, 82), (61, ABSENT)]
    }
    /// OFFSET2: service.
    Offset2 "OFFSET2" short {
        safety: [(0, 83), (33, 85), (36, 83), (61, ABSENT)]
    }
    /// OFFSET3: service.
    Offset3 "OFFSET3" short {
        safety: [(0, 84), (33, 86), (36, 84), (61, ABSENT)]
    }
    /// OT: open target (counts), also a travel limit.
    Ot "OT" wide { safety: [(0, 34), (61, ABSENT)], motor: [(61, 54)] }
    /// OTEMP: over-temperature limit (degree Celsius).
    Otemp "OTEMP" short { safety: [(0, 40), (61, 11)], motor: [(61, 11)], force_torque: [(0, 11)] }
    /// OV: offset vector of the force/torque sensor: EEPROM, 1 s per value.
    Ov "OV" short { force_torque: [(0, 59)] }
    /// P: motor position (counts): 22 bits packed on GET, SET redefines it.
    P "P" wide { safety: [(0, 26), (61, ABSENT)], motor: [(61, 48)] }
    /// PDATA: service (VERS 114..118).
    Pdata "PDATA" short { motor: [(114, 102), (119, ABSENT)] }
    /// PEN: pendant word, see `PendantState`.
    Pen "PEN" wide {
        safety: [(0, 85), (33, 87), (36, 85), (61, 43)]
    }
    /// PIDX: place 1..=4 in the packed torque frame.
    Pidx "PIDX" short { safety: [(0, 54), (61, ABSENT)], motor: [(61, 67), (64, 68), (65, 70)] }
    /// PLOG: service (VERS 114..118).
    Plog "PLOG" short { motor: [(114, 101), (119, ABSENT)] }
    /// POLES: motor poles.
    Poles "POLES" short { safety: [(44, 112), (61, ABSENT)], motor: [(61, 87), (65, 90)] }
    /// PTEMP: highest temperature seen (degree Celsius).
    Ptemp "PTEMP" short { safety: [(0, 22), (61, 10)], motor: [(61, 10)], force_torque: [(0, 10)] }
    /// PWR: power.
    Pwr "PWR" short {
        safety: [(0, 99), (33, 101), (36, 99), (61, 53)]
    }
    /// RATIO: service.
    Ratio "RATIO" short {
        safety: [(0, 72), (33, 74), (36, 72), (61, ABSENT)]
    }
    /// ROLE: what the puck is, see `Role`.
    Role "ROLE" short { monitor: [(0, 1)], safety: [(0, 1)], motor: [(61, 1)], force_torque: [(0, 1)] }
    /// SAFE: service modes of the safety module: do not touch.
    Safe "SAFE" short {
        safety: [(0, 86), (33, 88), (36, 86), (61, 44)]
    }
    /// SAMPLE: service.
    Sample "SAMPLE" short {
        safety: [(0, 68), (33, 70), (36, 68), (61, ABSENT)]
    }
    /// SAVE: save the property named by the value to EEPROM.
    Save "SAVE" short {
        monitor: [(0, 9)], safety: [(0, 87), (33, 89), (36, 87), (61, 30)],
        motor: [(61, 30)], force_torque: [(0, 30)]
    }
    /// SG: strain gauge of a finger, 0..=4095.
    Sg "SG" short {
        safety: [(0, 56), (33, 58), (36, 56), (61, 25)], motor: [(61, 25)],
        force_torque: [(0, 25)]
    }
    /// SG1: gauge 1 of the force/torque sensor.
    Sg1 "SG1" short { force_torque: [(0, 42)] }
    /// SG2: gauge 2 of the force/torque sensor.
    Sg2 "SG2" short { force_torque: [(0, 43)] }
    /// SG3: gauge 3 of the force/torque sensor.
    Sg3 "SG3" short { force_torque: [(0, 44)] }
    /// SG4: gauge 4 of the force/torque sensor.
    Sg4 "SG4" short { force_torque: [(0, 45)] }
    /// SG5: gauge 5 of the force/torque sensor.
    Sg5 "SG5" short { force_torque: [(0, 46)] }
    /// SG6: gauge 6 of the force/torque sensor.
    Sg6 "SG6" short { force_torque: [(0, 47)] }
    /// SN: serial number.
    Sn "SN" short { monitor: [(0, 2)], safety: [(0, 2)], motor: [(61, 2)], force_torque: [(0, 2)] }
    /// STAT: 0 monitor, 1 error, 2 ready, see `Status`.
    Stat "STAT" short { monitor: [(0, 5)], safety: [(0, 5)], motor: [(61, 5)], force_torque: [(0, 5)] }
    /// T: commanded torque (current units).
    T "T" short { safety: [(0, 10), (50, 9), (61, ABSENT)], motor: [(61, 42)] }
    /// T1: gauge temperature 1.
    T1 "T1" short { force_torque: [(0, 61)] }
    /// T2: gauge temperature 2.
    T2 "T2" short { force_torque: [(0, 62)] }
    /// T3: gauge temperature 3.
    T3 "T3" short { force_torque: [(0, 63)] }
    /// TACT: tactile format; SET answers like GET.
    Tact "TACT" short { motor: [(142, 106)] }
    /// TACTID: -2 if the tactile array failed to initialise.
    Tactid "TACTID" short { motor: [(145, 107)] }
    /// TEMP: temperature of the puck (degree Celsius).
    Temp "TEMP" short { safety: [(0, 39), (61, 9)], motor: [(61, 9)], force_torque: [(0, 9)] }
    /// TENSO: tensioner offset.
    Tenso "TENSO" short {
        safety: [(33, 108), (36, 106), (61, ABSENT)], motor: [(61, 81), (65, 84)]
    }
    /// TENST: tensioner stop.
    Tenst "TENST" short {
        safety: [(33, 107), (36, 105), (61, ABSENT)], motor: [(61, 80), (65, 83)]
    }
    /// TETAE: electrical angle.
    Tetae "TETAE" short { safety: [(45, 116), (61, ABSENT)] }
    /// THERM: temperature of the motor (degree Celsius).
    Therm "THERM" short { safety: [(0, 46), (61, 20)], motor: [(61, 20)], force_torque: [(0, 20)] }
    /// TIE: tie inner and outer link.
    Tie "TIE" short { motor: [(65, 95), (132, 100)] }
    /// TL1: torque that warns (packed-torque units).
    Tl1 "TL1" short {
        safety: [(0, 92), (33, 94), (36, 92), (61, 47)]
    }
    /// TL2: torque that faults (packed-torque units).
    Tl2 "TL2" short {
        safety: [(0, 93), (33, 95), (36, 93), (61, 48)]
    }
    /// TSTOP: stall time that ends a move; 0 never.
    Tstop "TSTOP" short {
        safety: [(0, 64), (33, 66), (36, 64), (61, ABSENT)],
        motor: [(61, 75), (65, 78)]
    }
    /// TX: x torque alone.
    Tx "TX" short { force_torque: [(0, 51)] }
    /// TY: y torque alone.
    Ty "TY" short { force_torque: [(0, 52)] }
    /// TZ: z torque alone.
    Tz "TZ" short { force_torque: [(0, 53)] }
    /// UNITS: service.
    Units "UNITS" short {
        safety: [(0, 71), (33, 73), (36, 71), (61, ABSENT)]
    }
    /// UPSECS: seconds since power-up.
    Upsecs "UPSECS" short { safety: [(0, 23), (61, ABSENT)], motor: [(61, 60), (64, 61), (65, 63)] }
    /// V: velocity command (counts/ms).
    V "V" short {
        safety: [(0, 12), (50, 10), (61, ABSENT)], motor: [(61, 44), (114, 106), (119, 44)]
    }
    /// VALUE: value to peek or poke.
    Value "VALUE" short { monitor: [(0, 7)], safety: [(0, 7)], motor: [(61, 7)], force_torque: [(0, 7)] }
    /// VALUE32: 32-bit value to peek or poke.
    Value32 "VALUE32" short {
        safety: [(50, 124), (51, 125), (61, ABSENT)]
    }
    /// VBUS: bus voltage.
    Vbus "VBUS" short { safety: [(0, 47), (61, 21)], motor: [(61, 21)], force_torque: [(0, 21)] }
    /// VCMD: velocity command (VERS 114..118).
    Vcmd "VCMD" short { motor: [(114, 44), (119, ABSENT)] }
    /// VERS: firmware version.
    Vers "VERS" short { monitor: [(0, 0)], safety: [(0, 0)], motor: [(61, 0)], force_torque: [(0, 0)] }
    /// VL1: velocity that warns (Q4.12 m/s).
    Vl1 "VL1" short {
        safety: [(0, 90), (33, 92), (36, 90), (61, 45)]
    }
    /// VL2: velocity that faults (Q4.12 m/s); 0 disables: never send it.
    Vl2 "VL2" short {
        safety: [(0, 91), (33, 93), (36, 91), (61, 46)]
    }
    /// VLOGIC: logic voltage.
    Vlogic "VLOGIC" short { safety: [(0, 49), (61, 23)], motor: [(61, 23)], force_torque: [(0, 23)] }
    /// VNOM: nominal bus voltage.
    Vnom "VNOM" short {
        safety: [(0, 104), (33, 106), (36, 104), (61, 56)]
    }
    /// VOLTH1: high voltage that warns.
    Volth1 "VOLTH1" short {
        safety: [(0, 96), (33, 98), (36, 96), (61, 51)]
    }
    /// VOLTH2: high voltage that faults.
    Volth2 "VOLTH2" short {
        safety: [(0, 97), (33, 99), (36, 97), (61, 52)]
    }
    /// VOLTL1: low voltage that warns.
    Voltl1 "VOLTL1" short {
        safety: [(0, 94), (33, 96), (36, 94), (61, 49)]
    }
    /// VOLTL2: low voltage that faults.
    Voltl2 "VOLTL2" short {
        safety: [(0, 95), (33, 97), (36, 95), (61, 50)]
    }
    /// X0: expansion 0.
    X0 "X0" short { safety: [(61, 34)], motor: [(61, 34)], force_torque: [(0, 34)] }
    /// X1: expansion 1.
    X1 "X1" short { safety: [(61, 35)], motor: [(61, 35)], force_torque: [(0, 35)] }
    /// X2: expansion 2.
    X2 "X2" short { safety: [(61, 36)], motor: [(61, 36)], force_torque: [(0, 36)] }
    /// X3: expansion 3.
    X3 "X3" short { safety: [(61, 37)], motor: [(61, 37)], force_torque: [(0, 37)] }
    /// X4: expansion 4.
    X4 "X4" short { safety: [(61, 38)], motor: [(61, 38)], force_torque: [(0, 38)] }
    /// X5: expansion 5.
    X5 "X5" short { safety: [(61, 39)], motor: [(61, 39)], force_torque: [(0, 39)] }
    /// X6: expansion 6.
    X6 "X6" short { safety: [(61, 40)], motor: [(61, 40)], force_torque: [(0, 40)] }
    /// X7: expansion 7.
    X7 "X7" short { safety: [(61, 41)], motor: [(61, 41)], force_torque: [(0, 41)] }
    /// ZERO: 1 once the arm is zeroed (tip-velocity supervision).
    Zero "ZERO" short {
        safety: [(0, 55), (33, 56), (36, 55), (61, 42)]
    }
}
