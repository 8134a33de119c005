#pragma once
// SQLite behind one class: transactions that are there whole after a crash, or not at all.

#include <cstdint>
#include <mutex>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>

#include "server/base/outcome.h"

struct sqlite3;
struct sqlite3_stmt;

namespace pointwright::server {

/// What SQLite refused. Leaves Database::change() and read() as a problem.
class DatabaseError : public std::runtime_error {
 public:
  DatabaseError(const std::string& text, int code, int system)
      : std::runtime_error(text), code_(code), system_(system) {}
  [[nodiscard]] int code() const { return code_; }      ///< extended
  [[nodiscard]] int system() const { return system_; }  ///< errno, where the system was asked

 private:
  int code_;
  int system_;
};

/// One statement under way, its values bound in order.
class Statement {
 public:
  Statement(sqlite3* database, sqlite3_stmt* statement) : database_(database), statement_(statement) {}
  Statement(Statement&& other) noexcept
      : database_(other.database_), statement_(std::exchange(other.statement_, nullptr)) {}
  Statement& operator=(Statement&&) = delete;
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;
  ~Statement();  ///< ready to be used again

  void bind(int place, std::int64_t value);
  void bind(int place, std::string_view text);               ///< which must outlive the statement
  void bind(int place, std::span<const std::byte> content);  ///< the same
  /// The next row; false after the last one.
  bool step();
  [[nodiscard]] std::int64_t integer(int column) const;
  [[nodiscard]] std::string text(int column) const;
  [[nodiscard]] bool is_null(int column) const;
  /// Valid until the next step.
  [[nodiscard]] std::span<const std::byte> content(int column) const;

 private:
  void check(int code) const;
  sqlite3* database_;
  sqlite3_stmt* statement_;
};

/// One connection, which its users take in turns. Thread-safe.
class Database {
 public:
  /// The one who has the connection. Errors of its methods: DatabaseError.
  class Access {
   public:
    /// `sql` is a literal: statements are prepared once.
    template <typename... Values>
    Statement query(std::string_view sql, const Values&... values) {
      Statement statement(owner_.connection_, owner_.prepared(sql));
      int place = 0;
      (statement.bind(++place, values), ...);
      return statement;
    }
    /// Runs it to its end; how many rows it changed.
    template <typename... Values>
    std::int64_t run(std::string_view sql, const Values&... values) {
      Statement statement = query(sql, values...);
      while (statement.step()) {
      }
      return owner_.changed_rows();
    }

   private:
    friend class Database;
    explicit Access(Database& owner) : owner_(owner) {}
    Database& owner_;
  };

  /// Opens the file, or a database in memory where the path is empty, and brings its layout up to date. What
  /// is written to a file is on the disk before a change returns.
  /// `newest`: stops at that layout; tests make older ones with it.
  /// Throws std::runtime_error with a sentence: it is no database, a newer program wrote it, the system
  /// refuses.
  explicit Database(const std::string& path, int newest = layout());
  ~Database();
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  /// The number of the layout that this program writes.
  static int layout();
  /// Whether the pages fit together. Cost: reads the whole file.
  [[nodiscard]] bool is_sound();
  /// Whether the disk has failed: nothing is written any more.
  [[nodiscard]] bool has_failed() const;

  /// Runs work(Access&) -> Outcome<T> as one transaction: a problem or an exception takes all of it back.
  /// Problems: those of the work; kOutOfDisk; kStorageFailed, from then on for every change
  template <typename Work>
  auto change(Work work) -> decltype(work(std::declval<Access&>())) {
    const std::lock_guard lock(mutex_);
    if (failed_) return failure();
    try {
      Transaction transaction(*this);
      Access access(*this);
      auto outcome = work(access);
      if (outcome.ok()) transaction.commit();
      return outcome;
    } catch (const DatabaseError& error) {
      return problem_of(error);
    }
  }
  /// Runs work(Access&), which changes nothing. Throws DatabaseError.
  template <typename Work>
  auto read(Work work) -> decltype(work(std::declval<Access&>())) {
    const std::lock_guard lock(mutex_);
    Access access(*this);
    return work(access);
  }

 private:
  class Transaction {
   public:
    explicit Transaction(Database& owner);
    Transaction(const Transaction&) = delete;
    Transaction& operator=(const Transaction&) = delete;
    ~Transaction();  ///< takes it back unless it was committed
    void commit();

   private:
    Database& owner_;
    bool open_ = true;
  };

  sqlite3_stmt* prepared(std::string_view sql);
  [[nodiscard]] std::int64_t changed_rows() const;
  void execute(const std::string& sql);
  void set_up(const std::string& path, int newest);
  void close();
  protocol::Problem problem_of(const DatabaseError& error);
  [[nodiscard]] static protocol::Problem failure();

  sqlite3* connection_ = nullptr;
  mutable std::mutex mutex_;  // guards all but the pointer above
  std::unordered_map<std::string_view, sqlite3_stmt*> statements_;
  bool failed_ = false;
};

}  // namespace pointwright::server
