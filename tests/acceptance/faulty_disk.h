#pragma once
// A data folder on a disk that fails on demand, and what a loss of power would leave of it.

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "tests/acceptance/daemon.h"
#include "tests/support/faulty_disk_page.h"

namespace pointwright::test {

/// The disk of one daemon at a time; tests/support/faulty_disk.cpp says what it does.
class FaultyDisk {
 public:
  FaultyDisk();
  ~FaultyDisk();
  FaultyDisk(const FaultyDisk&) = delete;
  FaultyDisk& operator=(const FaultyDisk&) = delete;

  /// False where the daemon is built with a sanitizer, which has such calls of its own.
  static bool works();
  /// The data folder as it is, unsynced bytes and all.
  [[nodiscard]] std::string data() const { return folder_ / "data"; }
  [[nodiscard]] std::vector<std::string> arguments() const { return {"--data", data()}; }
  /// What a daemon needs to have this disk.
  [[nodiscard]] std::vector<std::string> environment() const;
  [[nodiscard]] FaultyDiskPage& page() { return *page_; }

  /// Which names there are after a loss of power. File systems bring names to the disk when they are asked
  /// to, or earlier.
  enum class Names { kSynced, kAll };
  /// Another folder, as the data folder would be after a loss of power: of every file the bytes that were
  /// synced.
  std::string after_power_loss(Names names);

 private:
  /// `files`: by inode, where the file was put, for its further names.
  void restore(const std::string& below, const std::string& to, Names names,
               std::map<std::string, std::string>& files);

  TemporaryFolder folder_;
  FaultyDiskPage* page_ = nullptr;
  int restored_ = 0;
};

}  // namespace pointwright::test
