#include "server/metrics/metrics.h"

#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>

namespace pointwright::server {
namespace {

constexpr std::string_view kOther = "other";
/// The steps that take time: those that sessions measure, and the reading and writing of files.
constexpr std::array<std::string_view, 11> kSteps = {"decode", "encode",    "build",   "derive_levels",
                                                     "field",  "paint",     "preview", "edit",
                                                     "commit", "move_head", kOther};

std::string number(double value) {
  std::array<char, 32> text{};
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), value).ptr};
}

void write_head(std::string& text, std::string_view name, std::string_view help, std::string_view type) {
  text.append("# HELP ").append(name).append(" ").append(help).append("\n");
  text.append("# TYPE ").append(name).append(" ").append(type).append("\n");
}

void write_sample(std::string& text, std::string_view name, std::string_view labels, double value) {
  text.append(name);
  if (!labels.empty()) text.append("{").append(labels).append("}");
  text.append(" ").append(number(value)).append("\n");
}

void write_counter(std::string& text, std::string_view name, std::string_view help, std::uint64_t value) {
  write_head(text, name, help, "counter");
  write_sample(text, name, "", static_cast<double>(value));
}

}  // namespace

void Histogram::add(double seconds) {
  if (!(seconds >= 0.0)) return;
  const auto border = std::lower_bound(kBorders.begin(), kBorders.end(), seconds);
  counts_[static_cast<std::size_t>(border - kBorders.begin())].fetch_add(1, std::memory_order_relaxed);
  sum_us_.fetch_add(static_cast<std::uint64_t>(std::min(seconds, 1e9) * 1e6), std::memory_order_relaxed);
}

void Histogram::write(std::string& text, std::string_view name, std::string_view labels) const {
  const std::string before = labels.empty() ? std::string() : std::string(labels).append(",");
  const std::string buckets = std::string(name).append("_bucket");
  std::uint64_t total = 0;
  for (std::size_t i = 0; i < counts_.size(); ++i) {
    total += counts_[i].load(std::memory_order_relaxed);
    const std::string border = i < kBorders.size() ? number(kBorders[i]) : "+Inf";
    write_sample(text, buckets, std::string(before).append("le=\"").append(border).append("\""),
                 static_cast<double>(total));
  }
  write_sample(text, std::string(name).append("_sum"), labels,
               static_cast<double>(sum_us_.load(std::memory_order_relaxed)) / 1e6);
  write_sample(text, std::string(name).append("_count"), labels, static_cast<double>(total));
}

Metrics::Metrics(const std::vector<std::string>& routes) {
  for (const std::string& route : routes) requests_.emplace(route, std::make_unique<Statuses>());
  requests_.emplace("none", std::make_unique<Statuses>());
  for (const std::string_view step : kSteps) steps_[std::string(step)];
}

void Metrics::count_request(const RequestLog& request) {
  // HEAD is answered by GET's row.
  const std::string_view method = request.method == "HEAD" ? std::string_view("GET") : request.method;
  auto row = requests_.find(std::string(method).append(" ").append(request.route));
  if (row == requests_.end()) row = requests_.find("none");
  const int status = std::clamp(request.status - kLeastStatus, 0, static_cast<int>(kStatuses) - 1);
  (*row->second)[static_cast<std::size_t>(status)].fetch_add(1, std::memory_order_relaxed);
  received_.fetch_add(request.request_bytes, std::memory_order_relaxed);
  sent_.fetch_add(request.response_bytes, std::memory_order_relaxed);
  if (!request.is_stream) durations_.add(request.duration_ms / 1e3);
  for (const auto& [name, ms] : request.timings)
    if (name == "decode" || name == "encode") add_time(name, ms / 1e3);  // sessions tell the others
}

void Metrics::add_time(std::string_view step, double seconds) {
  auto row = steps_.find(step);
  if (row == steps_.end()) row = steps_.find(kOther);
  row->second.add(seconds);
}

void Metrics::count_frame(std::uint64_t bytes, std::uint64_t passed_over) {
  frames_.fetch_add(1, std::memory_order_relaxed);
  frame_bytes_.fetch_add(bytes, std::memory_order_relaxed);
  frames_passed_over_.fetch_add(passed_over, std::memory_order_relaxed);
}

std::string Metrics::text(const std::vector<Gauge>& gauges) const {
  std::string text;
  write_head(text, "pointwright_requests_total", "Requests answered, by route and status.", "counter");
  for (const auto& [route, statuses] : requests_) {
    const std::size_t space = route.find(' ');
    const bool is_row = space != std::string::npos;
    std::string labels = "method=\"";
    labels.append(is_row ? route.substr(0, space) : std::string()).append("\",route=\"");
    labels.append(is_row ? route.substr(space + 1) : route).append("\",status=\"");
    for (std::size_t i = 0; i < kStatuses; ++i) {
      const std::uint64_t count = (*statuses)[i].load(std::memory_order_relaxed);
      if (count == 0) continue;
      std::string all = labels;
      all.append(std::to_string(static_cast<int>(i) + kLeastStatus)).append("\"");
      write_sample(text, "pointwright_requests_total", all, static_cast<double>(count));
    }
  }
  write_head(text, "pointwright_request_seconds", "From the first byte to the end of the answer; no streams.",
             "histogram");
  durations_.write(text, "pointwright_request_seconds", "");
  write_head(text, "pointwright_step_seconds", "Steps of work.", "histogram");
  for (const auto& [step, histogram] : steps_)
    histogram.write(text, "pointwright_step_seconds", std::string("step=\"").append(step).append("\""));
  write_counter(text, "pointwright_received_bytes_total", "Bytes of requests.", received_);
  write_counter(text, "pointwright_sent_bytes_total", "Bytes of the bodies of answers.", sent_);
  write_counter(text, "pointwright_frames_total", "Frames sent by streams.", frames_);
  write_counter(text, "pointwright_frame_bytes_total", "Bytes of those frames.", frame_bytes_);
  write_counter(text, "pointwright_frames_dropped_total",
                "Versions of a picture that a stream passed over because a newer one was there.",
                frames_passed_over_);
  std::string_view last;
  for (const Gauge& gauge : gauges) {
    if (gauge.name != last) write_head(text, gauge.name, gauge.help, "gauge");
    last = gauge.name;
    write_sample(text, gauge.name, gauge.labels, gauge.value);
  }
  return text;
}

std::uint64_t resident_bytes() {
  std::ifstream file("/proc/self/statm");
  std::uint64_t total = 0;
  std::uint64_t resident = 0;
  file >> total >> resident;
  return file ? resident * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE)) : 0;
}

std::uint64_t free_bytes(const std::string& folder) {
  struct statvfs status {};
  if (folder.empty() || ::statvfs(folder.c_str(), &status) != 0) return 0;
  return std::uint64_t{status.f_bavail} * status.f_frsize;
}

}  // namespace pointwright::server
