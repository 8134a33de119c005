#include "server/cli/remote/arguments.h"

#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <thread>

#include "server/base/random_id.h"
#include "server/cli/local_file.h"

namespace pointwright::server {
namespace {

using nlohmann::json;

CommandFailure wrong(const std::string& option, const std::string& text) {
  return {.code = ExitCode::kUsage, .text = std::string(option).append(": ").append(text)};
}

}  // namespace

json numbers_of(const std::string& option, const std::string& text, std::size_t count) {
  json numbers = json::array();
  const char* at = text.data();
  const char* const end = at + text.size();
  while (true) {
    double value = 0;
    const auto read = std::from_chars(at, end, value);
    if (read.ec != std::errc() || !std::isfinite(value))
      throw wrong(option, "numbers with commas between them");
    numbers.push_back(value);
    at = read.ptr;
    if (at == end) break;
    if (*at != ',') throw wrong(option, "numbers with commas between them");
    ++at;
  }
  if (count != 0 && numbers.size() != count)
    throw wrong(option, std::to_string(count).append(" numbers with commas between them"));
  return numbers;
}

json document_argument(const std::string& option, const std::string& text) {
  std::string content = text;
  if (text == "@-") {
    content.assign(std::istreambuf_iterator<char>(std::cin), {});
  } else if (!text.empty() && text.front() == '@') {
    std::ifstream file(text.substr(1), std::ios::binary);
    if (!file) throw wrong(option, text.substr(1).append(" cannot be read"));
    content.assign(std::istreambuf_iterator<char>(file), {});
  }
  json document = json::parse(content, nullptr, false);
  if (document.is_discarded()) throw wrong(option, "not a JSON document");
  return document;
}

std::string if_match(const std::optional<std::uint64_t>& revision) {
  return revision ? std::string("\"r").append(std::to_string(*revision)).append("\"") : "*";
}

std::string format_of_target(const std::string& target) {
  const auto format = format_of_name(target);
  if (!format) return {};
  return std::string(format_name(format.value()));
}

std::uint64_t download(const RemoteService& service, HttpRequest request, const std::string& target,
                       std::ostream& out, std::optional<std::uint64_t> expected) {
  std::uint64_t written = 0;
  const auto check_whole = [&] {
    if (!expected || written == *expected) return;
    throw CommandFailure{.code = ExitCode::kUnreachable,
                         .text = std::string("the download ended after ")
                                     .append(std::to_string(written))
                                     .append(" of ")
                                     .append(std::to_string(*expected))
                                     .append(" bytes")};
  };
  if (target == "-") {
    request.write_body = [&](const char* bytes, std::size_t count) {
      out.write(bytes, static_cast<std::streamsize>(count));
      written += count;
      return out.good();
    };
    (void)service.ask(std::move(request));
    out.flush();
    check_whole();
    return written;
  }
  const std::string part = std::string(target).append(".").append(random_id()).append(".part");
  std::ofstream file(part, std::ios::binary);
  if (!file) throw wrong(target, "cannot be written");
  request.write_body = [&](const char* bytes, std::size_t count) {
    file.write(bytes, static_cast<std::streamsize>(count));
    written += count;
    return file.good();
  };
  std::error_code error;
  try {
    (void)service.ask(std::move(request));
    file.close();
    if (!file.good()) throw wrong(target, "cannot be written; is the disk full?");
    check_whole();
    std::filesystem::rename(part, target, error);
    if (error) throw wrong(target, "cannot be written");
  } catch (...) {
    const bool is_bad = !file.good();
    std::filesystem::remove(part, error);
    if (is_bad) throw wrong(target, "cannot be written; is the disk full?");
    throw;
  }
  return written;
}

ProgressLine::ProgressLine(std::ostream& err, bool is_wanted)
    : err_(err), is_shown_(is_wanted && ::isatty(STDERR_FILENO) == 1) {}

ProgressLine::~ProgressLine() {
  if (last_ >= 0) err_ << "\r\033[K" << std::flush;
}

void ProgressLine::show(std::string_view what, double fraction) {
  constexpr int kWidth = 30;
  const int percent = static_cast<int>(std::clamp(fraction, 0.0, 1.0) * 100.0);
  if (!is_shown_ || (percent == last_ && what == last_what_)) return;
  last_ = percent;
  last_what_ = what;
  const int filled = kWidth * percent / 100;
  err_ << "\r\033[K" << what << " [" << std::string(static_cast<std::size_t>(filled), '#')
       << std::string(static_cast<std::size_t>(kWidth - filled), '.') << "] " << percent << " %"
       << std::flush;
}

bool wait_until(const std::function<bool()>& is_done, const std::optional<double>& timeout_seconds) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point start = Clock::now();
  double pause = 0.02;
  while (!is_done()) {
    const double passed = std::chrono::duration<double>(Clock::now() - start).count();
    if (timeout_seconds && passed >= *timeout_seconds) return false;
    std::this_thread::sleep_for(std::chrono::duration<double>(pause));
    pause = std::min(1.0, pause * 1.5);
  }
  return true;
}

}  // namespace pointwright::server
