#pragma once
// Sessions to test, without a server around them.

#include <doctest/doctest.h>

#include <chrono>
#include <cstdint>
#include <memory>
#include <thread>
#include <utility>

#include "server/sessions/session.h"
#include "tests/server/stand_in_resampler.h"
#include "tests/server/synthetic.h"

namespace pointwright::test {

using namespace server;
using protocol::ProblemKind;

/// Waits until the condition holds.
template <typename Condition>
bool comes_true(Condition condition) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return true;
}

/// Pools, and sessions on a small sheet.
struct Workshop {
  explicit Workshop(int threads = 0) : interactive(2, threads), background(1, threads) {}
  ComputePool interactive;
  ComputePool background;
  std::shared_ptr<const Cloud> cloud = std::make_shared<const Cloud>(wavy_sheet(40));
  HierarchyParams hierarchy{.scales = {0.05F}};
  std::size_t max_edits = 50;
  std::size_t max_operations = 5;
  std::size_t max_painting_vertices = 1'000'000;
  std::uint64_t max_samples = 1'000'000;
  Resampler resample = double_every_tenth;

  std::shared_ptr<Session> open(std::uint64_t history_bytes = 1ULL << 30U,
                                HierarchyBuilder build = build_hierarchy) {
    SessionParams params;
    params.id = "AAAAAAAAAAAAAAAAAAAAAA";
    params.name = "sheet";
    params.cloud_id = "BBBBBBBBBBBBBBBBBBBBBB";
    params.cloud = cloud;
    params.hierarchy = hierarchy;
    params.history_bytes = history_bytes;
    params.max_edits = max_edits;
    params.max_operations = max_operations;
    params.max_painting_vertices = max_painting_vertices;
    params.room = std::make_shared<SampleRoom>(max_samples);
    return Session::create(std::move(params), {.interactive = interactive,
                                               .background = background,
                                               .build = std::move(build),
                                               .resample = resample});
  }
  std::shared_ptr<Session> ready(std::uint64_t history_bytes = 1ULL << 30U) {
    auto session = open(history_bytes);
    REQUIRE(comes_true([&] { return session->document()->state != protocol::SessionState::kBuilding; }));
    REQUIRE(session->document()->state == protocol::SessionState::kReady);
    return session;
  }
  std::shared_ptr<Session> painted(std::uint64_t history_bytes = 1ULL << 30U) {
    auto session = ready(history_bytes);
    REQUIRE(session->paint(RegionKind::kZero, left_of(0.2)).ok());
    REQUIRE(session->paint(RegionKind::kOne, right_of(0.8)).ok());
    return session;
  }
};

inline std::shared_ptr<const RecordedEdit> commit(Session& session, const EditParams& params) {
  const auto committed = session.commit(params, session.document()->revision);
  REQUIRE(committed.ok());
  return committed.value().record;
}

inline const Level& finest(const Session& session) {
  return session.document()->surface.surface->finest();
}

inline ProblemKind kind_of(const auto& outcome) {
  REQUIRE_FALSE(outcome.ok());
  return outcome.problem().kind;
}

}  // namespace pointwright::test
