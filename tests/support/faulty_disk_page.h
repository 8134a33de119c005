#pragma once
// The page of memory by which a test steers the disk of the daemon that it runs; see faulty_disk.cpp.

#include <array>
#include <atomic>
#include <cstdint>

namespace pointwright::test {

/// Lies in a file that both processes have mapped; FaultyDisk::kVariable names it to the daemon. The paths
/// are set before the daemon starts, the numbers may change at any time.
struct FaultyDiskPage {
  std::array<char, 512> data;             ///< the folder whose files are meant, without a slash at its end
  std::array<char, 512> durable;          ///< a folder for what would be there after a loss of power
  std::atomic<std::int64_t> sync_count;   ///< fsync and fdatasync so far
  std::atomic<std::int64_t> write_count;  ///< write and pwrite so far
  std::atomic<std::int64_t> cut_at;  ///< at that sync the power goes, before it has done anything; 0: never
  std::atomic<std::int64_t> fail_syncs_from;  ///< from that sync on all syncs fail (EIO); 0: never
  std::atomic<std::int64_t>
      fail_writes_from;            ///< from that write on all writes and syncs fail (EIO); 0: never
  std::atomic<std::int64_t> room;  ///< bytes by which files may still grow (ENOSPC); negative: any number
};
static_assert(std::atomic<std::int64_t>::is_always_lock_free);

inline constexpr const char* kFaultyDiskVariable = "POINTWRIGHT_FAULTY_DISK";

}  // namespace pointwright::test
