#include "server/store/database.h"

#include <fcntl.h>
#include <sqlite3.h>

#include <cerrno>

#include "server/ingest/child_process.h"
#include "server/store/schema.h"

namespace pointwright::server {

using protocol::Problem;
using protocol::ProblemKind;

namespace {

constexpr int kBusyTimeoutMs = 5000;

/// SQLite tells the system's error of some failures alone; of a write that fails it is the thread's own.
DatabaseError error_of(sqlite3* database, int code) {
  const int own = errno;
  const int extended = sqlite3_extended_errcode(database);
  const int system = sqlite3_system_errno(database);
  return {sqlite3_errmsg(database), extended == SQLITE_OK ? code : extended, system == 0 ? own : system};
}

bool is_full(const DatabaseError& error) {
  if ((error.code() & 0xff) == SQLITE_FULL) return true;
  const bool is_io = (error.code() & 0xff) == SQLITE_IOERR || (error.code() & 0xff) == SQLITE_CANTOPEN;
  return is_io && (error.system() == ENOSPC || error.system() == EDQUOT || error.system() == EFBIG);
}

}  // namespace

Statement::~Statement() {
  if (statement_ == nullptr) return;
  sqlite3_reset(statement_);
  sqlite3_clear_bindings(statement_);
}

void Statement::check(int code) const {
  if (code != SQLITE_OK) throw error_of(database_, code);
}

void Statement::bind(int place, std::int64_t value) {
  check(sqlite3_bind_int64(statement_, place, value));
}

void Statement::bind(int place, std::string_view text) {
  check(sqlite3_bind_text64(statement_, place, text.data() == nullptr ? "" : text.data(), text.size(),
                            SQLITE_STATIC, SQLITE_UTF8));
}

void Statement::bind(int place, std::span<const std::byte> content) {
  static constexpr std::byte kNothing{};
  check(sqlite3_bind_blob64(statement_, place, content.empty() ? &kNothing : content.data(), content.size(),
                            SQLITE_STATIC));
}

bool Statement::step() {
  errno = 0;
  const int code = sqlite3_step(statement_);
  if (code != SQLITE_ROW && code != SQLITE_DONE) throw error_of(database_, code);
  return code == SQLITE_ROW;
}

std::int64_t Statement::integer(int column) const {
  return sqlite3_column_int64(statement_, column);
}

std::string Statement::text(int column) const {
  const auto bytes = content(column);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

bool Statement::is_null(int column) const {
  return sqlite3_column_type(statement_, column) == SQLITE_NULL;
}

std::span<const std::byte> Statement::content(int column) const {
  const void* const data = sqlite3_column_blob(statement_, column);
  const int size = sqlite3_column_bytes(statement_, column);
  return {static_cast<const std::byte*>(data), data == nullptr ? 0 : static_cast<std::size_t>(size)};
}

int Database::layout() {
  return static_cast<int>(migrations().size());
}

Database::Database(const std::string& path, int newest) {
  const std::string name = path.empty() ? "the database" : "the database " + path;
  try {
    set_up(path, newest);
  } catch (const DatabaseError& error) {
    const std::string why = error.what();
    close();
    throw std::runtime_error(name + " cannot be used: " + why);
  } catch (...) {
    close();
    throw;
  }
}

void Database::set_up(const std::string& path, int newest) {
  if (!path.empty()) {
    // SQLite would let others read it.
    const Descriptor file(::open(path.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0600));
    if (!file.is_open()) throw std::runtime_error("the database " + path + " cannot be opened");
  }
  const char* const place = path.empty() ? ":memory:" : path.c_str();
  if (const int code = sqlite3_open_v2(
          place, &connection_, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX, nullptr);
      code != SQLITE_OK)
    throw error_of(connection_, code);
  sqlite3_extended_result_codes(connection_, 1);
  sqlite3_busy_timeout(connection_, kBusyTimeoutMs);
  // One daemon has the folder: no index of the log has to be shared, and none can fail on a full disk.
  execute("PRAGMA locking_mode=EXCLUSIVE");
  execute("PRAGMA journal_mode=WAL");
  execute("PRAGMA synchronous=FULL");
  execute("PRAGMA foreign_keys=ON");
  Access access(*this);
  std::int64_t have = 0;
  {
    Statement version = access.query("PRAGMA user_version");
    version.step();
    have = version.integer(0);
  }
  if (have > layout())
    throw std::runtime_error("the database " + path +
                             " was written by a newer version of pointwrightd (layout " +
                             std::to_string(have) + ", this one knows " + std::to_string(layout()) + ")");
  for (; have < newest; ++have) {
    Transaction transaction(*this);
    execute(std::string(migrations()[static_cast<std::size_t>(have)]));
    execute("PRAGMA user_version=" + std::to_string(have + 1));
    transaction.commit();
  }
}

void Database::close() {
  for (const auto& [sql, statement] : statements_) sqlite3_finalize(statement);
  statements_.clear();
  sqlite3_close(connection_);
  connection_ = nullptr;
}

Database::~Database() {
  close();
}

bool Database::is_sound() {
  try {
    return read([](Access& access) {
      Statement check = access.query("PRAGMA quick_check(1)");
      return check.step() && check.text(0) == "ok";
    });
  } catch (const DatabaseError&) {
    return false;
  }
}

bool Database::has_failed() const {
  const std::lock_guard lock(mutex_);
  return failed_;
}

sqlite3_stmt* Database::prepared(std::string_view sql) {
  const auto found = statements_.find(sql);
  if (found != statements_.end() && sqlite3_stmt_busy(found->second) == 0) return found->second;
  POINTWRIGHT_CHECK(found == statements_.end(), "a statement that is used twice at once");
  sqlite3_stmt* statement = nullptr;
  const int code = sqlite3_prepare_v3(connection_, sql.data(), static_cast<int>(sql.size()),
                                      SQLITE_PREPARE_PERSISTENT, &statement, nullptr);
  if (code != SQLITE_OK) throw error_of(connection_, code);
  statements_.emplace(sql, statement);
  return statement;
}

std::int64_t Database::changed_rows() const {
  return sqlite3_changes64(connection_);
}

void Database::execute(const std::string& sql) {
  errno = 0;
  if (const int code = sqlite3_exec(connection_, sql.c_str(), nullptr, nullptr, nullptr); code != SQLITE_OK)
    throw error_of(connection_, code);
}

Database::Transaction::Transaction(Database& owner) : owner_(owner) {
  owner_.execute("BEGIN IMMEDIATE");
}

void Database::Transaction::commit() {
  owner_.execute("COMMIT");
  open_ = false;
}

Database::Transaction::~Transaction() {
  // Some errors have taken it back already.
  if (open_ && sqlite3_get_autocommit(owner_.connection_) == 0)
    sqlite3_exec(owner_.connection_, "ROLLBACK", nullptr, nullptr, nullptr);
}

Problem Database::failure() {
  return {.kind = ProblemKind::kStorageFailed,
          .detail = "the disk has failed: nothing can be changed until the operator has looked into it"};
}

Problem Database::problem_of(const DatabaseError& error) {
  if (is_full(error))
    return {.kind = ProblemKind::kOutOfDisk, .detail = "the disk is full; nothing was changed"};
  const int kind = error.code() & 0xff;
  if (kind == SQLITE_CORRUPT)
    return {.kind = ProblemKind::kDamaged, .detail = "what is stored is damaged; nothing was changed"};
  // What was handed to the disk and not taken may or may not be there: trying again would hide it.
  if (kind == SQLITE_IOERR || kind == SQLITE_NOTADB || kind == SQLITE_READONLY) {
    failed_ = true;
    return failure();
  }
  throw std::runtime_error(std::string("the database refused a change: ") + error.what());
}

}  // namespace pointwright::server
