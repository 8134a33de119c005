#include "server/store/schema.h"

#include <array>

namespace pointwright::server {
namespace {

// `place` is the order of creation. `seal` is a hash of the row's other columns: a flipped bit is noticed.
// Times are milliseconds since 1970.
constexpr std::string_view kResources = R"sql(
CREATE TABLE clouds (
  place INTEGER PRIMARY KEY, id TEXT NOT NULL UNIQUE, owner TEXT NOT NULL,
  document TEXT NOT NULL,   -- what clients are told of it
  source TEXT NOT NULL,     -- how its file is read again
  content TEXT NOT NULL,    -- hash of its columns
  sha256 TEXT NOT NULL,     -- of its file: the name of the blob
  seal TEXT NOT NULL
);
CREATE INDEX clouds_of_file ON clouds (sha256);
CREATE TABLE images (
  place INTEGER PRIMARY KEY, id TEXT NOT NULL UNIQUE, owner TEXT NOT NULL,
  document TEXT NOT NULL, sha256 TEXT NOT NULL, seal TEXT NOT NULL
);
CREATE INDEX images_of_file ON images (sha256);
CREATE TABLE sessions (
  place INTEGER PRIMARY KEY, id TEXT NOT NULL UNIQUE, owner TEXT NOT NULL,
  cloud TEXT NOT NULL REFERENCES clouds (id),
  params TEXT NOT NULL,     -- name, levels, time of creation
  params_seal TEXT NOT NULL,
  revision INTEGER NOT NULL, head INTEGER NOT NULL, samples INTEGER NOT NULL,
  used INTEGER NOT NULL,
  seal TEXT NOT NULL,       -- of revision and head
  damage TEXT               -- why it is not served; null where it is
);
CREATE INDEX sessions_of_cloud ON sessions (cloud);
CREATE TABLE session_marks (
  session TEXT PRIMARY KEY REFERENCES sessions (id) ON DELETE CASCADE,
  runs BLOB NOT NULL, seal TEXT NOT NULL
);
CREATE TABLE operations (
  session TEXT NOT NULL REFERENCES sessions (id) ON DELETE CASCADE,
  region INTEGER NOT NULL, number INTEGER NOT NULL,
  operation TEXT NOT NULL, seal TEXT NOT NULL,
  UNIQUE (session, region, number)
);
CREATE TABLE edits (
  session TEXT NOT NULL REFERENCES sessions (id) ON DELETE CASCADE,
  number INTEGER NOT NULL,  -- 1 for the first one
  record TEXT NOT NULL,     -- parameters, counts, hash of the surface after it
  marks TEXT NOT NULL,      -- the painting that it was made with
  seal TEXT NOT NULL,
  UNIQUE (session, number)
);
CREATE TABLE paintings (
  session TEXT NOT NULL REFERENCES sessions (id) ON DELETE CASCADE,
  hash TEXT NOT NULL, runs BLOB NOT NULL,
  UNIQUE (session, hash)
);
)sql";

constexpr std::string_view kAnswers = R"sql(
CREATE TABLE answers (
  caller TEXT NOT NULL, key TEXT NOT NULL,
  fingerprint TEXT NOT NULL,  -- hash of the request
  created INTEGER NOT NULL,
  status INTEGER NOT NULL, type TEXT NOT NULL, headers TEXT NOT NULL, body TEXT NOT NULL,
  PRIMARY KEY (caller, key)
) WITHOUT ROWID;
CREATE INDEX answers_by_age ON answers (created);
)sql";

constexpr std::string_view kRegions = R"sql(
CREATE TABLE regions (
  session TEXT NOT NULL REFERENCES sessions (id) ON DELETE CASCADE,
  name TEXT NOT NULL,       -- of a region besides zero and one
  members BLOB NOT NULL,    -- by id of the sample
  seal TEXT NOT NULL,
  PRIMARY KEY (session, name)
);
CREATE TABLE region_operations (
  session TEXT NOT NULL, region TEXT NOT NULL, number INTEGER NOT NULL,
  operation TEXT NOT NULL, seal TEXT NOT NULL,
  UNIQUE (session, region, number),
  FOREIGN KEY (session, region) REFERENCES regions (session, name) ON DELETE CASCADE
);
)sql";

constexpr std::string_view kShares = R"sql(
CREATE TABLE shares (
  place INTEGER PRIMARY KEY, id TEXT NOT NULL UNIQUE,
  session TEXT NOT NULL REFERENCES sessions (id) ON DELETE CASCADE,
  owner TEXT NOT NULL,      -- the token of who shared; empty: none were in use
  scope TEXT NOT NULL,
  created INTEGER NOT NULL,
  expires INTEGER NOT NULL, -- -1: never
  sha256 TEXT NOT NULL,     -- of the capability, which is nowhere
  seal TEXT NOT NULL
);
CREATE INDEX shares_of_session ON shares (session);
)sql";

constexpr std::string_view kJobs = R"sql(
CREATE TABLE jobs (
  place INTEGER PRIMARY KEY, id TEXT NOT NULL UNIQUE, owner TEXT NOT NULL,
  terms TEXT NOT NULL,      -- what was asked for
  terms_seal TEXT NOT NULL,
  state TEXT NOT NULL,      -- where it stands, and what it made
  state_seal TEXT NOT NULL
);
)sql";

constexpr std::array kSteps{kResources, kAnswers, kRegions, kShares, kJobs};

}  // namespace

std::span<const std::string_view> migrations() {
  return kSteps;
}

}  // namespace pointwright::server
