#include "server/log/log.h"

#include <spdlog/async.h>
#include <spdlog/details/file_helper.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <cmath>
#include <stdexcept>
#include <thread>

#include "protocol/json/documents.h"
#include "server/base/request_scope.h"

namespace pointwright::server {
namespace {

constexpr std::size_t kQueuedLines = 8192;

spdlog::level::level_enum spdlog_level(LogLevel level) {
  switch (level) {
    case LogLevel::kDebug:
      return spdlog::level::debug;
    case LogLevel::kInfo:
      return spdlog::level::info;
    case LogLevel::kWarn:
      return spdlog::level::warn;
    case LogLevel::kError:
      return spdlog::level::err;
  }
  return spdlog::level::info;
}

/// A file that can be opened again under its name.
class FileSink final : public spdlog::sinks::base_sink<std::mutex> {
 public:
  explicit FileSink(const std::string& path) { file_.open(path); }
  void reopen() {
    const std::lock_guard lock(mutex_);
    file_.reopen(false);
  }

 protected:
  void sink_it_(const spdlog::details::log_msg& message) override {
    spdlog::memory_buf_t line;
    formatter_->format(message, line);
    file_.write(line);
  }
  void flush_() override { file_.flush(); }

 private:
  spdlog::details::file_helper file_;
};

}  // namespace

struct Log::Sink {
  std::shared_ptr<FileSink> file;  // null: standard error
  std::shared_ptr<spdlog::details::thread_pool> threads;
  std::shared_ptr<spdlog::async_logger> logger;
};

Log::Log(const std::string& level, const std::string& file) : sink_(std::make_unique<Sink>()) {
  spdlog::sink_ptr target;
  try {
    if (file.empty()) {
      target = std::make_shared<spdlog::sinks::stderr_sink_mt>();
    } else {
      sink_->file = std::make_shared<FileSink>(file);
      target = sink_->file;
    }
  } catch (const spdlog::spdlog_ex& error) {
    throw std::runtime_error(std::string("cannot open the log: ") + error.what());
  }
  sink_->threads = std::make_shared<spdlog::details::thread_pool>(kQueuedLines, 1U);
  sink_->logger = std::make_shared<spdlog::async_logger>("pointwright", std::move(target), sink_->threads,
                                                         spdlog::async_overflow_policy::overrun_oldest);
  sink_->logger->set_pattern("%v");
  sink_->logger->set_level(spdlog::level::from_str(level == "warn" ? "warning" : level));
  sink_->logger->flush_on(spdlog::level::warn);
  // Failures of the sink itself (a full disk) are nobody's reason to stop.
  sink_->logger->set_error_handler([](const std::string&) {});
}

Log::~Log() {
  sink_->logger->flush();
  sink_->threads.reset();  // writes what is left, and ends: nobody else has the logger then
}

void Log::write(LogLevel level, const std::string& event, protocol::JsonDocument members) {
  if (!sink_->logger->should_log(spdlog_level(level))) return;
  const auto level_name = spdlog::level::to_string_view(spdlog_level(level));
  protocol::JsonDocument line{{"time", protocol::to_rfc3339(std::chrono::system_clock::now())},
                              {"level", std::string(level_name.data(), level_name.size())},
                              {"event", event}};
  if (const std::string& id = current_request_id(); !id.empty()) line["request_id"] = id;
  for (auto& [name, value] : members.items()) line[name] = std::move(value);
  sink_->logger->log(spdlog_level(level), protocol::to_text(line));
}

std::optional<std::string> Log::reopen() {
  if (sink_->file == nullptr) return std::nullopt;
  try {
    sink_->file->reopen();
  } catch (const spdlog::spdlog_ex& error) {
    return error.what();
  }
  return std::nullopt;
}

void Log::flush() {
  sink_->logger->flush();
  // The queue has no barrier; its one thread writes a line in microseconds.
  for (int i = 0; i < 50 && sink_->threads->queue_size() > 0; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
}

void Log::request(const RequestLog& request) {
  protocol::JsonDocument members{{"request_id", request.request_id},
                                 {"method", request.method},
                                 {"path", request.path},
                                 {"route", request.route},
                                 {"status", request.status},
                                 {"duration_ms", std::round(request.duration_ms * 1000.0) / 1000.0},
                                 {"request_bytes", request.request_bytes},
                                 {"response_bytes", request.response_bytes}};
  if (!request.token.empty()) members["token"] = request.token;
  if (!request.failure.empty()) members["failure"] = request.failure;
  const bool failed = request.status >= 500 && request.status != 503 && request.status != 507;
  write(failed || !request.failure.empty() ? LogLevel::kError : LogLevel::kInfo, "request",
        std::move(members));
}

}  // namespace pointwright::server
