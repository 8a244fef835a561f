//! The tables of a campaign file, and their version.
//!
//! A file of an older version is brought up step by step when it is opened for writing; reading never changes it.

/// Marks the file as ours (`JRIG`).
pub const APPLICATION_ID: i32 = i32::from_be_bytes(*b"JRIG");

/// Version of the tables, in SQLite's `user_version`.
pub const VERSION: i32 = 4;

/// `STEPS[n]` turns version n into version n + 1; a new file takes them all. A step that was released is frozen.
pub const STEPS: [&str; VERSION as usize] = [FIRST, SEALS, FRFS, LEVELS];

/// The first version whose files hold FRFs from elsewhere.
pub const WITH_FRFS: i32 = 3;

/// The first version whose files hold levels of the shaker.
pub const WITH_LEVELS: i32 = 4;

/// Version 1. Raw records are append-only: triggers refuse any change.
const FIRST: &str = "
CREATE TABLE meta (
    key   TEXT PRIMARY KEY,
    value TEXT NOT NULL
) STRICT;

CREATE TABLE plan (
    id     INTEGER PRIMARY KEY,
    utc    TEXT NOT NULL,
    source TEXT NOT NULL,
    text   TEXT NOT NULL
) STRICT;

-- one row per connection to a device
CREATE TABLE sessions (
    id               INTEGER PRIMARY KEY,
    utc              TEXT NOT NULL,
    address          TEXT NOT NULL,
    board            TEXT NOT NULL,
    serial           TEXT NOT NULL,
    firmware_version TEXT NOT NULL,
    target           TEXT NOT NULL,
    build            TEXT NOT NULL,
    schema_hash      TEXT NOT NULL,
    software_version TEXT NOT NULL,
    rate_hz          INTEGER NOT NULL
) STRICT;

-- SI value = code * units_per_volt * range_v / 32768
CREATE TABLE channels (
    session        INTEGER NOT NULL REFERENCES sessions(id),
    place          INTEGER NOT NULL,
    name           TEXT NOT NULL,
    role           TEXT NOT NULL,
    quantity       TEXT NOT NULL,
    unit           TEXT NOT NULL,
    units_per_volt REAL NOT NULL,
    range_v        REAL NOT NULL,
    delay_ns       INTEGER NOT NULL,
    bits           INTEGER NOT NULL,
    PRIMARY KEY (session, place)
) STRICT;

CREATE TABLE cells (
    id            INTEGER PRIMARY KEY,
    configuration TEXT NOT NULL,
    impact        TEXT NOT NULL,
    response      TEXT NOT NULL,
    wanted        INTEGER NOT NULL,
    given_up      TEXT,
    UNIQUE (configuration, impact, response)
) STRICT;

-- one row per firing of the hammer; without samples where the bolt did not arrive
CREATE TABLE records (
    id            INTEGER PRIMARY KEY,
    cell          INTEGER NOT NULL REFERENCES cells(id),
    attempt       INTEGER NOT NULL,
    session       INTEGER NOT NULL REFERENCES sessions(id),
    utc           TEXT NOT NULL,
    epoch         INTEGER NOT NULL,
    first_scan    INTEGER NOT NULL,
    trigger_index INTEGER NOT NULL,
    scans         INTEGER NOT NULL,
    channels      INTEGER NOT NULL,
    pulse_us      INTEGER NOT NULL,
    peak_n        REAL NOT NULL,
    shot          TEXT NOT NULL,
    gaps          TEXT NOT NULL,
    verdict       TEXT NOT NULL,
    measure       REAL NOT NULL,
    limit_value   REAL NOT NULL,
    sentence      TEXT NOT NULL,
    crc32         INTEGER NOT NULL,
    seal          INTEGER NOT NULL,
    samples       BLOB NOT NULL,
    UNIQUE (cell, attempt)
) STRICT;

CREATE TABLE overrules (
    id      INTEGER PRIMARY KEY,
    record  INTEGER NOT NULL REFERENCES records(id),
    utc     TEXT NOT NULL,
    verdict TEXT NOT NULL,
    reason  TEXT NOT NULL
) STRICT;

CREATE TABLE log (
    id   INTEGER PRIMARY KEY,
    utc  TEXT NOT NULL,
    text TEXT NOT NULL
) STRICT;

CREATE TRIGGER records_stay BEFORE UPDATE ON records
BEGIN SELECT RAISE(ABORT, 'a raw record is never changed'); END;
CREATE TRIGGER records_remain BEFORE DELETE ON records
BEGIN SELECT RAISE(ABORT, 'a raw record is never deleted'); END;
";

/// Version 2: what was found when a record was stored, with a seal over all of it; the link's counters; the sensors.
const SEALS: &str = "
-- one row per record, stored with it. bytes_crc32 runs over the bytes in records.samples, seal over every other
-- column of both rows (see seal.rs)
CREATE TABLE seals (
    record      INTEGER PRIMARY KEY REFERENCES records(id),
    peak_n      REAL NOT NULL,
    utc_error_s REAL,
    bytes_crc32 INTEGER NOT NULL,
    seal        INTEGER NOT NULL
) STRICT;
CREATE TRIGGER seals_stay BEFORE UPDATE ON seals
BEGIN SELECT RAISE(ABORT, 'a record''s seal is never changed'); END;
CREATE TRIGGER seals_remain BEFORE DELETE ON seals
BEGIN SELECT RAISE(ABORT, 'a record''s seal is never deleted'); END;

-- counters of a session's link so far, a JSON object of numbers
CREATE TABLE links (
    session  INTEGER PRIMARY KEY REFERENCES sessions(id),
    counters TEXT NOT NULL
) STRICT;

-- what the plan says about the sensor behind a channel; sensitivity and polarity are in channels.units_per_volt
CREATE TABLE sensors (
    session    INTEGER NOT NULL REFERENCES sessions(id),
    place      INTEGER NOT NULL,
    model      TEXT,
    serial     TEXT,
    calibrated TEXT,
    PRIMARY KEY (session, place)
) STRICT;

-- why a cell is done with fewer good hits than wanted, but enough
ALTER TABLE cells ADD COLUMN settled TEXT;
";

/// Version 3: FRFs that were measured elsewhere.
const FRFS: &str = "
-- the latest row of a configuration counts. frequency, frf and variance are f64, little-endian: frf (line, output, input) with real
-- and imaginary part in turn, variance (line, output, input) of the real part. outputs and inputs are JSON lists of names
CREATE TABLE frfs (
    id            INTEGER PRIMARY KEY,
    configuration TEXT NOT NULL,
    utc           TEXT NOT NULL,
    source        TEXT NOT NULL,
    quantity      TEXT NOT NULL,
    sigma_per_s   REAL NOT NULL,
    outputs       TEXT NOT NULL,
    inputs        TEXT NOT NULL,
    frequency     BLOB NOT NULL,
    frf           BLOB NOT NULL,
    variance      BLOB,
    crc32         INTEGER NOT NULL
) STRICT;
CREATE TRIGGER frfs_stay BEFORE UPDATE ON frfs
BEGIN SELECT RAISE(ABORT, 'imported FRFs are never changed'); END;
CREATE TRIGGER frfs_remain BEFORE DELETE ON frfs
BEGIN SELECT RAISE(ABORT, 'imported FRFs are never deleted'); END;
";

/// Version 4: levels of the shaker.
const LEVELS: &str = "
-- one row per level that was recorded: a sine held in steady state, or a sweep from rest to rest. amplitude and reached are m, N
-- or V as control is displacement, force or drive. The seal runs over all other columns but samples (see levels.rs)
CREATE TABLE levels (
    id           INTEGER PRIMARY KEY,
    session      INTEGER NOT NULL REFERENCES sessions(id),
    utc          TEXT NOT NULL,
    moment       TEXT NOT NULL,
    frequency_hz REAL NOT NULL,
    end_hz       REAL,
    control      TEXT NOT NULL,
    amplitude    REAL NOT NULL,
    reached      REAL NOT NULL,
    overshoot    REAL NOT NULL,
    settle_s     REAL NOT NULL,
    drive_v      REAL NOT NULL,
    epoch        INTEGER NOT NULL,
    first_scan   INTEGER NOT NULL,
    scans        INTEGER NOT NULL,
    channels     INTEGER NOT NULL,
    gaps         TEXT NOT NULL,
    crc32        INTEGER NOT NULL,
    bytes_crc32  INTEGER NOT NULL,
    seal         INTEGER NOT NULL,
    samples      BLOB NOT NULL
) STRICT;
CREATE TRIGGER levels_stay BEFORE UPDATE ON levels
BEGIN SELECT RAISE(ABORT, 'a raw record is never changed'); END;
CREATE TRIGGER levels_remain BEFORE DELETE ON levels
BEGIN SELECT RAISE(ABORT, 'a raw record is never deleted'); END;
";
