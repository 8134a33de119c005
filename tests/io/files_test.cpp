#include "server/ingest/files.h"

#include <doctest/doctest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "tests/io/io_support.h"

namespace pointwright::io_test {
namespace {

namespace fs = std::filesystem;

class Folder {
 public:
  Folder() {
    std::string name = (fs::temp_directory_path() / "pointwright-files-XXXXXX").string();
    REQUIRE(mkdtemp(name.data()) != nullptr);
    path_ = name;
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  ~Folder() { fs::remove_all(path_); }
  [[nodiscard]] std::string operator/(const char* name) const { return (path_ / name).string(); }
  [[nodiscard]] std::size_t count() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(path_), {}));
  }

 private:
  fs::path path_;
};

TEST_CASE("what was written is read, and replaces what was there") {
  const Folder folder;
  const std::string path = folder / "cloud.ply";
  for (const char* text : {"first", "", "a longer second one"}) {
    REQUIRE(write_file_atomically(path, bytes_of(text)).ok());
    CHECK(text_of(read_file(path).value()) == text);
    CHECK(folder.count() == 1);  // nothing temporary is left
  }
  struct stat info {};
  REQUIRE(stat(path.c_str(), &info) == 0);
  CHECK((info.st_mode & 0777) == 0600);
}

TEST_CASE("what a killed writer left beside a file goes, and nothing that another one still writes") {
  const Folder folder;
  const std::string path = folder / "cloud.ply";
  const pid_t child = ::fork();
  REQUIRE(child >= 0);
  if (child == 0) ::_exit(0);
  REQUIRE(::waitpid(child, nullptr, 0) == child);
  const std::string dead = path + ".new-" + std::to_string(child) + "-0";
  const std::vector<std::string> others{path,
                                        path + ".new-" + std::to_string(::getpid()) + "-7",
                                        path + ".new-",
                                        path + ".new-" + std::to_string(child),
                                        path + ".new-plan",
                                        path + ".new-" + std::to_string(child) + "-notes.txt",
                                        path + ".new-2024-05-01",
                                        folder / "other.ply.new-" + std::to_string(child) + "-0"};
  for (const std::string& name : others) REQUIRE(write_file_atomically(name, bytes_of("x")).ok());
  REQUIRE(write_file_atomically(dead, bytes_of("x")).ok());
  remove_leftovers(path);
  CHECK_FALSE(fs::exists(dead));
  for (const std::string& name : others) CHECK(fs::exists(name));
}

TEST_CASE("files that are not there, no files, or too large are told apart") {
  const Folder folder;
  CHECK(read_file(folder / "nothing").error().code == ErrorCode::kInvalidArgument);
  CHECK(read_file(folder / ".").error().code == ErrorCode::kInvalidArgument);
  const std::string path = folder / "six";
  REQUIRE(write_file_atomically(path, bytes_of("123456")).ok());
  CHECK(read_file(path, 6).ok());
  const auto large = read_file(path, 5);
  REQUIRE_FALSE(large.ok());
  CHECK(large.error().code == ErrorCode::kTooLarge);
  CHECK(large.error().actual == 6.0);
}

TEST_CASE("a write that fails leaves the old file and nothing else") {
  const Folder folder;
  CHECK_FALSE(write_file_atomically(folder / "no/such/folder", bytes_of("x")).ok());
  fs::create_directory(folder / "taken");
  CHECK_FALSE(write_file_atomically(folder / "taken", bytes_of("x")).ok());  // a folder has the name
  CHECK(folder.count() == 1);
}

}  // namespace
}  // namespace pointwright::io_test
