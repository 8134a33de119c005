#include <array>

#include "server/handlers/handlers.h"

namespace pointwright::server {
namespace {

void add_budget(std::vector<Gauge>& held, std::vector<Gauge>& total, const char* name, const Budget& budget) {
  const std::string label = std::string("budget=\"").append(name).append("\"");
  held.push_back({.name = "pointwright_budget_held",
                  .help = "What is held of each budget, in bytes or pieces.",
                  .labels = label,
                  .value = static_cast<double>(budget.held())});
  total.push_back({.name = "pointwright_budget_total",
                   .help = "How much of each budget there is.",
                   .labels = label,
                   .value = static_cast<double>(budget.total())});
}

/// Sessions by state and the samples they hold.
void add_sessions(const Service& service, std::vector<Gauge>& gauges) {
  std::array<double, 4> states{};
  double samples = 0.0;
  for (const protocol::SessionSummary& summary : service.sessions.summaries()) {
    states.at(static_cast<std::size_t>(summary.state)) += 1.0;
    samples += static_cast<double>(summary.sample_count);
  }
  for (std::size_t i = 0; i < states.size(); ++i) {
    const auto state = protocol::session_state_name(static_cast<protocol::SessionState>(i));
    gauges.push_back({.name = "pointwright_sessions",
                      .help = "Sessions by state.",
                      .labels = std::string("state=\"").append(state).append("\""),
                      .value = states.at(i)});
  }
  gauges.push_back({.name = "pointwright_session_samples",
                    .help = "Samples of all sessions, those included that sleep.",
                    .labels = {},
                    .value = samples});
}

void add_jobs(const Service& service, std::vector<Gauge>& gauges) {
  std::array<double, protocol::kJobStatusNames.size()> counts{};
  for (const protocol::JobDocument& job : service.jobs.list([](const std::string&) { return true; }))
    counts.at(static_cast<std::size_t>(job.status)) += 1.0;
  for (std::size_t i = 0; i < counts.size(); ++i)
    gauges.push_back({.name = "pointwright_jobs",
                      .help = "Jobs by status.",
                      .labels = std::string("status=\"").append(protocol::kJobStatusNames.at(i)).append("\""),
                      .value = counts.at(i)});
}

}  // namespace

Response get_metrics(Service& service, const Request&) {
  std::vector<Gauge> gauges;
  const auto add = [&](std::string_view name, std::string_view help, double value, std::string labels = {}) {
    gauges.push_back({.name = name, .help = help, .labels = std::move(labels), .value = value});
  };
  add("pointwright_streams", "Streams that are open.", static_cast<double>(service.streams.held()));
  if (service.connections)
    add("pointwright_connections", "Connections that are served.",
        static_cast<double>(service.connections()));
  add("pointwright_clouds", "Clouds that are held.", static_cast<double>(service.clouds.list().size()));
  add("pointwright_images", "Images that are held.", static_cast<double>(service.images.list().size()));
  add_sessions(service, gauges);
  add_jobs(service, gauges);
  constexpr std::string_view kWaiting = "Tasks that wait for a thread of the pool.";
  add("pointwright_pool_waiting", kWaiting, static_cast<double>(service.interactive.waiting()),
      "pool=\"interactive\"");
  add("pointwright_pool_waiting", kWaiting, static_cast<double>(service.background.waiting()),
      "pool=\"background\"");
  std::vector<Gauge> totals;
  add_budget(gauges, totals, "uploads", service.upload_memory);
  add_budget(gauges, totals, "documents", service.json_memory);
  add_budget(gauges, totals, "answers", service.answer_memory);
  add_budget(gauges, totals, "streams", service.streams);
  add_budget(gauges, totals, "clouds", service.clouds.memory());
  add_budget(gauges, totals, "images", service.images.memory());
  add_budget(gauges, totals, "sessions", service.sessions.memory());
  gauges.insert(gauges.end(), totals.begin(), totals.end());
  add("process_resident_memory_bytes", "Memory that the process has.", static_cast<double>(resident_bytes()));
  if (!service.config.data.empty())
    add("pointwright_disk_free_bytes", "What the data folder's file system has left.",
        static_cast<double>(free_bytes(service.config.data)));
  return {.content_type = "text/plain; version=0.0.4; charset=utf-8", .body = service.metrics.text(gauges)};
}

}  // namespace pointwright::server
