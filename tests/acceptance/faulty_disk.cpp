#include "tests/acceptance/faulty_disk.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <new>
#include <stdexcept>

namespace pointwright::test {

namespace fs = std::filesystem;

namespace {

struct Name {
  std::string inode;
  bool is_folder = false;
  std::string name;
};

std::vector<Name> synced_names(const std::string& list) {
  std::vector<Name> names;
  std::ifstream file(list);
  std::string kind;
  for (Name name; file >> name.inode >> kind && file.ignore(1) && std::getline(file, name.name);) {
    name.is_folder = kind == "d";
    names.push_back(name);
  }
  return names;
}

std::vector<Name> current_names(const std::string& folder) {
  std::vector<Name> names;
  if (!fs::exists(folder)) return names;
  for (const auto& entry : fs::directory_iterator(folder)) {
    struct stat info {};
    if (::lstat(entry.path().c_str(), &info) != 0) throw std::runtime_error("cannot look at a file");
    names.push_back({std::to_string(info.st_ino), entry.is_directory(), entry.path().filename().string()});
  }
  return names;
}

}  // namespace

FaultyDisk::FaultyDisk() {
  const std::string file = folder_ / "page";
  const int page = ::open(file.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (page < 0 || ::ftruncate(page, sizeof(FaultyDiskPage)) != 0)
    throw std::runtime_error("cannot make the disk's page");
  void* const memory = ::mmap(nullptr, sizeof(FaultyDiskPage), PROT_READ | PROT_WRITE, MAP_SHARED, page, 0);
  ::close(page);
  if (memory == MAP_FAILED) throw std::runtime_error("cannot map the disk's page");
  page_ = new (memory) FaultyDiskPage{};
  page_->room = -1;
  const std::string durable = folder_ / "durable";
  fs::create_directories(durable + "/files");
  fs::create_directories(durable + "/names");
  const std::string root = data();
  if (std::max(root.size(), durable.size()) >= page_->data.size())
    throw std::runtime_error("too long a path for the disk's page");
  root.copy(page_->data.data(), root.size());
  durable.copy(page_->durable.data(), durable.size());
}

FaultyDisk::~FaultyDisk() {
  ::munmap(page_, sizeof(FaultyDiskPage));
}

bool FaultyDisk::works() {
#ifdef POINTWRIGHT_SANITIZED
  return false;
#else
  return true;
#endif
}

std::vector<std::string> FaultyDisk::environment() const {
  std::string page = kFaultyDiskVariable;
  page.append("=").append(folder_ / "page");
  return {"LD_PRELOAD=" FAULTY_DISK_PATH, page};
}

std::string FaultyDisk::after_power_loss(Names names) {
  std::string to = folder_ / ("after-" + std::to_string(++restored_));
  std::map<std::string, std::string> files;
  restore("", to, names, files);
  return to;
}

void FaultyDisk::restore(const std::string& below, const std::string& to, Names names,
                         std::map<std::string, std::string>& files) {
  fs::create_directory(to);
  std::string flat = below;
  std::replace(flat.begin(), flat.end(), '/', '%');
  const auto list = names == Names::kSynced ? synced_names(folder_ / ("durable/names/" + flat + "%"))
                                            : current_names(data() + "/" + below);
  for (const Name& entry : list) {
    const std::string target = to + "/" + entry.name;
    if (entry.is_folder) {
      restore(below.empty() ? entry.name : below + "/" + entry.name, target, names, files);
      continue;
    }
    const auto [same, is_first] = files.emplace(entry.inode, target);
    if (!is_first) {
      fs::create_hard_link(same->second, target);
      continue;
    }
    const std::string bytes = folder_ / ("durable/files/" + entry.inode);
    if (fs::exists(bytes)) {
      fs::copy_file(bytes, target);
    } else {
      std::ofstream(target).flush();  // a name without bytes
    }
  }
}

}  // namespace pointwright::test
