#pragma once

#include <doctest/doctest.h>
#include <sqlite3.h>

#include <string>

namespace pointwright::test {

/// SQL by SQLite's own hands.
inline void run_sql(const std::string& path, const std::string& sql) {
  sqlite3* database = nullptr;
  REQUIRE(sqlite3_open(path.c_str(), &database) == SQLITE_OK);
  char* error = nullptr;
  const int code = sqlite3_exec(database, sql.c_str(), nullptr, nullptr, &error);
  const std::string told = error == nullptr ? "" : error;
  sqlite3_free(error);
  sqlite3_close(database);
  REQUIRE_MESSAGE(code == SQLITE_OK, told);
}

}  // namespace pointwright::test
