// What is below clouds and sessions that last: the folder, the database, files by content, marks as runs.

#include <doctest/doctest.h>

#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <thread>

#include "server/base/sha256.h"
#include "server/store/answers.h"
#include "server/store/blob_store.h"
#include "server/store/data_folder.h"
#include "server/store/database.h"
#include "server/store/marks_code.h"
#include "tests/server/sql.h"
#include "tests/server/temporary_folder.h"

using namespace pointwright;
using namespace pointwright::server;
using pointwright::test::TemporaryFolder;
using protocol::ProblemKind;

namespace {

std::string refusal_of(const std::string& path) {
  try {
    const DataFolder folder(path);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

void write_text(const std::string& path, const std::string& text) {
  std::ofstream(path) << text;
}

std::span<const std::byte> bytes_of(const std::string& text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}

std::int64_t count_of(Database& database, std::string_view sql) {
  return database.read([&](Database::Access& access) {
    Statement row = access.query(sql);
    REQUIRE(row.step());
    return row.integer(0);
  });
}

}  // namespace

TEST_CASE("a data folder is private, has one user at a time and is there again for the next one") {
  const TemporaryFolder temporary;
  const std::string path = temporary / "data";
  {
    const DataFolder folder(path);
    CHECK(folder.lasts());
    for (const std::string& each : {path, folder.blobs(), folder.uploads(), folder.quarantine()}) {
      struct stat info {};
      REQUIRE(::stat(each.c_str(), &info) == 0);
      CHECK((info.st_mode & 0777U) == 0700U);
    }
    CHECK(refusal_of(path).find("in use by another pointwrightd") != std::string::npos);
    write_text(folder.blobs() + "/kept", "text");
  }
  const DataFolder again(path + "/");
  CHECK(again.path() == path);
  CHECK(std::filesystem::exists(again.blobs() + "/kept"));
}

TEST_CASE("a data folder that holds other things, or that a newer program wrote, is refused and unharmed") {
  const TemporaryFolder temporary;
  const std::string path = temporary / "home";
  std::filesystem::create_directory(path);
  write_text(path + "/letter.txt", "dear");
  CHECK(refusal_of(path).find("holds other files") != std::string::npos);
  CHECK_FALSE(std::filesystem::exists(path + "/blobs"));

  const std::string newer = temporary / "newer";
  { const DataFolder folder(newer); }
  write_text(newer + "/version", "2\n");
  CHECK(refusal_of(newer).find("newer version") != std::string::npos);
  write_text(newer + "/version", "1 or so\n");
  CHECK(refusal_of(newer).find("damaged version file") != std::string::npos);

  write_text(temporary / "file", "text");
  CHECK(refusal_of(temporary / "file").find("cannot be made") != std::string::npos);
  CHECK(refusal_of(temporary / "missing/below").find("cannot be made") != std::string::npos);
}

TEST_CASE("without a path the folder is private to the process and gone at the end") {
  std::string path;
  {
    const DataFolder folder("");
    path = folder.path();
    CHECK_FALSE(folder.lasts());
    CHECK(std::filesystem::exists(folder.uploads()));
  }
  CHECK_FALSE(std::filesystem::exists(path));
}

TEST_CASE(
    "a database of an older layout is brought up to date and keeps what it holds; a newer one is refused") {
  const TemporaryFolder temporary;
  const std::string path = temporary / "old.db";
  {
    Database old(path, 1);
    const auto added = old.change([](Database::Access& access) -> Outcome<Done> {
      access.run(
          "INSERT INTO clouds (id, owner, document, source, content, sha256, seal) VALUES ('c', '', '{}', "
          "'{}', '', '', '')");
      return Done{};
    });
    REQUIRE(added.ok());
    CHECK(count_of(old, "SELECT count(*) FROM sqlite_master WHERE name = 'answers'") == 0);
  }
  {
    Database now(path);
    CHECK(now.is_sound());
    CHECK(count_of(now, "SELECT count(*) FROM clouds") == 1);
    CHECK(count_of(now, "SELECT count(*) FROM answers") == 0);
    CHECK(count_of(now, "PRAGMA user_version") == Database::layout());
    CHECK(count_of(now, "PRAGMA synchronous") == 2);
    CHECK(count_of(now, "PRAGMA foreign_keys") == 1);
  }
  struct stat info {};
  REQUIRE(::stat(path.c_str(), &info) == 0);
  CHECK((info.st_mode & 0777U) == 0600U);
  test::run_sql(path, "PRAGMA user_version=99");
  CHECK_THROWS_WITH_AS(Database{path}, doctest::Contains("newer version"), std::runtime_error);
  write_text(temporary / "text.db", std::string(5000, 'x'));
  CHECK_THROWS_AS(Database{temporary / "text.db"}, std::runtime_error);
}

TEST_CASE("a change that meets a problem, or throws, is taken back whole") {
  Database database("");
  const auto insert = [](Database::Access& access) {
    access.run("INSERT INTO images (id, owner, document, sha256, seal) VALUES ('i', '', '{}', 'abc', '')");
  };
  const auto refused = database.change([&](Database::Access& access) -> Outcome<Done> {
    insert(access);
    return protocol::Problem{.kind = ProblemKind::kTooMany, .detail = "enough"};
  });
  REQUIRE_FALSE(refused.ok());
  CHECK(refused.problem().kind == ProblemKind::kTooMany);
  CHECK_THROWS_AS((void)database.change([&](Database::Access& access) -> Outcome<Done> {
    insert(access);
    throw std::logic_error("midway");
  }),
                  std::logic_error);
  CHECK(count_of(database, "SELECT count(*) FROM images") == 0);
  const auto done = database.change([&](Database::Access& access) -> Outcome<Done> {
    insert(access);
    return Done{};
  });
  CHECK(done.ok());
  CHECK(count_of(database, "SELECT count(*) FROM images") == 1);
  CHECK_FALSE(database.has_failed());
}

TEST_CASE("a blob is what was put, stays while it is used or pinned, and is put aside once it is damaged") {
  const TemporaryFolder temporary;
  const DataFolder folder(temporary / "data");
  BlobStore blobs(folder);
  const std::string text = "all the samples";
  const std::string name = sha256_hex(bytes_of(text));
  const auto unused = [](const std::string&) { return false; };
  const auto used = [&](const std::string& sha256) { return sha256 == name; };
  {
    const auto pin = blobs.put(name, bytes_of(text));
    REQUIRE(pin.ok());
    blobs.drop(name, unused);
    REQUIRE(blobs.read(name).ok());
  }
  REQUIRE(blobs.put(name, bytes_of(text)).ok());  // again: it is there
  blobs.drop(name, used);
  const auto back = blobs.read(name);
  REQUIRE(back.ok());
  CHECK(std::ranges::equal(back.value(), bytes_of(text)));

  write_text(folder.blobs() + "/" + name + ".new-1-1", "half of it");
  blobs.sweep(used);
  CHECK(std::distance(std::filesystem::directory_iterator(folder.blobs()), {}) == 1);

  write_text(folder.blobs() + "/" + name, "all the simples");
  const auto damaged = blobs.read(name);
  REQUIRE_FALSE(damaged.ok());
  CHECK(damaged.problem().kind == ProblemKind::kDamaged);
  CHECK(std::filesystem::exists(folder.quarantine() + "/" + name));
  REQUIRE(blobs.put(name, bytes_of(text)).ok());  // uploaded once more
  CHECK(blobs.read(name).ok());
  blobs.drop(name, unused);
  CHECK_FALSE(blobs.read(name).ok());
}

TEST_CASE("nobody waits for a large blob that is being written, but who stores the same one") {
  const TemporaryFolder temporary;
  const DataFolder folder(temporary / "data");
  BlobStore blobs(folder);
  // Of another file system: it is copied, which takes its time.
  constexpr std::uint64_t kBytes = 128ULL << 20U;
  const Descriptor large(::memfd_create("large", MFD_CLOEXEC));
  REQUIRE(::ftruncate(large.get(), kBytes) == 0);
  Digest digest(Digest::Algorithm::kSha256);
  const std::vector<std::byte> zeros(1U << 20U);
  for (std::uint64_t done = 0; done < kBytes; done += zeros.size()) digest.add(zeros);
  const std::string name = to_hex(digest.finish());
  const std::string small = "all the samples";
  std::atomic<int> writing{2};
  const auto put_large = [&] {
    CHECK(blobs.put(name, {large.get(), kBytes}).ok());
    --writing;
  };
  std::thread first(put_large);
  std::thread second(put_large);
  int meanwhile = 0;
  while (writing == 2) {
    CHECK_FALSE(blobs.has_failed());
    CHECK(blobs.put(sha256_hex(bytes_of(small)), bytes_of(small)).ok());
    blobs.drop(sha256_hex(bytes_of(small)), [](const std::string&) { return false; });
    if (writing == 2) ++meanwhile;
  }
  first.join();
  second.join();
  CHECK(meanwhile >= 2);
  const auto back = blobs.open(name);
  REQUIRE(back.ok());
  CHECK(back.value()->size == kBytes);
}

TEST_CASE("marks come back from their runs, and nothing else comes from bytes that are none") {
  const auto there_and_back = [](const Marks& marks) {
    const auto back = decode_marks(encode_marks(marks));
    REQUIRE(back.has_value());
    CHECK(*back == marks);
  };
  there_and_back({});
  there_and_back({3});
  there_and_back(Marks(100'000, 0));
  Marks mixed;
  for (std::uint32_t i = 0; i < 5000; ++i)
    mixed.insert(mixed.end(), (i * 7919U) % 70U, static_cast<std::uint8_t>(i * 31U % 4U));
  there_and_back(mixed);
  CHECK(encode_marks(Marks(100'000, 2)).size() == 3);

  auto bytes = encode_marks(Marks(1000, 1));
  bytes.pop_back();
  CHECK_FALSE(decode_marks(bytes).has_value());                                 // ends within a run
  CHECK_FALSE(decode_marks(std::vector<std::byte>{std::byte{1}}).has_value());  // a run of nothing
  CHECK_FALSE(decode_marks(std::vector<std::byte>(9, std::byte{255})).has_value());
  CHECK(decode_marks(encode_marks(Marks(1000, 1)), 1000).has_value());
  CHECK_FALSE(decode_marks(encode_marks(Marks(1000, 1)), 999).has_value());
}

TEST_CASE("a key has one answer, belongs to one request, and is busy while that is under way") {
  Database database("");
  Answers answers(database, 2);
  {
    auto first = answers.claim("", "k1", "request");
    REQUIRE(first.ok());
    CHECK(std::holds_alternative<Answers::Turn>(first.value()));
    const auto second = answers.claim("", "k1", "request");
    REQUIRE_FALSE(second.ok());
    CHECK(second.problem().kind == ProblemKind::kKeyInUse);
    CHECK(answers.claim("somebody else", "k1", "request").ok());
    REQUIRE(answers
                .put(KeptAnswer{.caller = "",
                                .key = "k1",
                                .fingerprint = "request",
                                .status = 201,
                                .content_type = "application/json",
                                .headers = {{"ETag", "\"r1\""}},
                                .body = "{}"})
                .ok());
  }
  const auto again = answers.claim("", "k1", "request");
  REQUIRE(again.ok());
  const auto* kept = std::get_if<KeptAnswer>(&again.value());
  REQUIRE(kept != nullptr);
  CHECK(kept->status == 201);
  CHECK(kept->body == "{}");
  CHECK(kept->headers == std::vector<std::pair<std::string, std::string>>{{"ETag", "\"r1\""}});
  const auto other = answers.claim("", "k1", "another request");
  REQUIRE_FALSE(other.ok());
  CHECK(other.problem().kind == ProblemKind::kKeyReused);
  REQUIRE(answers.put(KeptAnswer{.key = "k2", .fingerprint = "x"}).ok());
  // Who has filled it makes room: the oldest go.
  const auto newcomer = answers.claim("another caller", "k3", "request");
  REQUIRE(newcomer.ok());
  CHECK(std::holds_alternative<Answers::Turn>(newcomer.value()));
  CHECK_FALSE(answers.claim("", "k2", "another request").ok());
  const auto forgotten = answers.claim("", "k1", "another request");
  REQUIRE(forgotten.ok());
  CHECK(std::holds_alternative<Answers::Turn>(forgotten.value()));
}

TEST_CASE("callers that fill the table of answers together keep nobody out") {
  constexpr std::uint64_t kMost = 320;
  constexpr int kEach = 20;  // a sixteenth
  Database database("");
  Answers answers(database, kMost);
  const auto ask = [&](const std::string& caller, int key) {
    auto claim = answers.claim(caller, std::to_string(key), "request");
    REQUIRE(claim.ok());
    const bool is_new = std::holds_alternative<Answers::Turn>(claim.value());
    if (is_new) {
      REQUIRE(answers.put({.caller = caller, .key = std::to_string(key), .fingerprint = "request"}).ok());
    }
    return is_new;
  };
  for (int guest = 0; guest < 16; ++guest)
    for (int key = 0; key < kEach; ++key) CHECK(ask("token/" + std::to_string(guest), key));
  for (int key = 0; key < kEach / 2; ++key) CHECK(ask("somebody else", key));
  // Whoever has fewest has lost nothing, and nobody everything.
  for (int key = 0; key < kEach / 2; ++key) CHECK_FALSE(ask("somebody else", key));
  for (int guest = 0; guest < 16; ++guest) CHECK_FALSE(ask("token/" + std::to_string(guest), kEach - 1));
  CHECK(count_of(database, "SELECT count(*) FROM answers") <= static_cast<std::int64_t>(kMost));
}

TEST_CASE("guests of one token push none of another's answers out, however many they are") {
  constexpr std::uint64_t kMost = 64;
  Database database("");
  Answers answers(database, kMost);
  const auto answer = [&](const std::string& caller, int key) {
    const auto claim = answers.claim(caller, std::to_string(key), "request");
    REQUIRE(claim.ok());
    if (!std::holds_alternative<Answers::Turn>(claim.value())) return false;
    REQUIRE(answers.put({.caller = caller, .key = std::to_string(key), .fingerprint = "request"}).ok());
    return true;
  };
  const std::string token(22, 'a');
  for (int key = 0; key < 4; ++key) answer(std::string(22, 'b'), key);
  for (int guest = 0; guest < 200; ++guest) answer(token + std::to_string(guest), 0);
  for (int key = 0; key < 4; ++key) CHECK_FALSE(answer(std::string(22, 'b'), key));
  CHECK_FALSE(answer(token + "199", 0));
  // So many callers that not each keeps one: who came last does.
  for (int other = 0; other < 200; ++other) answer(std::to_string(other), 0);
  CHECK_FALSE(answer("199", 0));
  CHECK(count_of(database, "SELECT count(*) FROM answers") <= static_cast<std::int64_t>(kMost));
}
