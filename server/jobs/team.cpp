#include "server/jobs/team.h"

#include <fcntl.h>
#include <unistd.h>

#include <nlohmann/json.hpp>
#include <utility>

#include "protocol/json/documents.h"
#include "server/base/descriptor.h"
#include "server/ingest/files.h"

namespace pointwright::server {

using protocol::Problem;

namespace {

std::span<const std::byte> bytes_of(const std::string& text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}

std::string text_of(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

class PlainFile final : public SharedFile {
 public:
  explicit PlainFile(Descriptor file) : file_(std::move(file)) {}
  bool write_at(std::span<const std::byte> bytes, std::uint64_t offset) override {
    return write_all_at(file_.get(), bytes, offset);
  }
  bool sync() override { return ::fsync(file_.get()) == 0; }

 private:
  Descriptor file_;
};

class LoneTeam final : public Team {
 public:
  [[nodiscard]] int rank() const override { return 0; }
  [[nodiscard]] int size() const override { return 1; }
  std::vector<std::vector<std::byte>> gather(std::span<const std::byte> mine) override {
    return {std::vector<std::byte>(mine.begin(), mine.end())};
  }
  std::unique_ptr<SharedFile> open(const std::string& path) override {
    Descriptor file(::open(path.c_str(), O_WRONLY | O_CLOEXEC));
    if (!file.is_open()) return nullptr;
    return std::make_unique<PlainFile>(std::move(file));
  }
};

}  // namespace

std::optional<Problem> Team::agree(const std::optional<Problem>& mine) {
  if (size() == 1) return mine;
  std::string said;
  if (mine) {
    protocol::JsonDocument document{{"slug", problem_info(mine->kind).slug}, {"detail", mine->detail}};
    if (mine->limit) document["limit"] = *mine->limit;
    if (mine->actual) document["actual"] = *mine->actual;
    said = protocol::to_text(document);
  }
  for (const auto& bytes : gather(bytes_of(said))) {
    if (bytes.empty()) continue;
    const auto document = protocol::Json::parse(text_of(bytes));
    Problem problem{.kind = protocol::find_problem(document.at("slug").get<std::string>())->kind,
                    .detail = document.at("detail").get<std::string>()};
    if (document.contains("limit")) problem.limit = document.at("limit").get<double>();
    if (document.contains("actual")) problem.actual = document.at("actual").get<double>();
    return problem;
  }
  return std::nullopt;
}

std::string Team::told(const std::string& by_leader) {
  if (size() == 1) return by_leader;
  return text_of(gather(leads() ? bytes_of(by_leader) : std::span<const std::byte>()).front());
}

std::unique_ptr<Team> lone_team() {
  return std::make_unique<LoneTeam>();
}

}  // namespace pointwright::server
