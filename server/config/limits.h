#pragma once
// Every limit that the operator can set: one table, from which the command line, the environment, the file,
// /v1/info and the documentation are made.

#include <cstdint>
#include <span>
#include <string_view>

namespace pointwright::server {

struct Limits {
  std::uint64_t max_upload_bytes = 1ULL << 30U;
  std::uint64_t max_uploads = 64;
  std::uint64_t max_upload_file_bytes = 16ULL << 30U;
  std::uint64_t upload_expiry_s = 86'400;
  std::uint64_t max_imports = 64;
  std::uint64_t max_samples = 20'000'000;
  std::uint64_t max_clouds = 64;
  std::uint64_t max_cloud_bytes = 4ULL << 30U;
  std::uint64_t max_images = 64;
  std::uint64_t max_image_bytes = 1ULL << 30U;
  std::uint64_t max_image_file_bytes = 256ULL << 20U;
  std::uint64_t max_image_side = 32'768;
  std::uint64_t max_image_pixels = 64ULL << 20U;
  std::uint64_t max_sessions = 32;
  std::uint64_t max_session_bytes = 8ULL << 30U;
  std::uint64_t max_session_samples = 20'000'000;
  std::uint64_t history_bytes = 512ULL << 20U;
  std::uint64_t max_edits = 10'000;
  std::uint64_t max_operations = 10'000;
  std::uint64_t max_painting_vertices = 1'000'000;
  std::uint64_t max_named_regions = 16;
  std::uint64_t max_kept_answers = 100'000;
  std::uint64_t session_idle_expiry_s = 0;
  std::uint64_t wake_wait_ms = 5'000;
  std::uint64_t max_json_bytes = 8ULL << 20U;
  std::uint64_t max_recipe_bytes = 32ULL << 20U;
  std::uint64_t max_json_depth = 32;
  std::uint64_t max_connections = 1024;
  std::uint64_t max_streams = 256;
  std::uint64_t max_decoders = 2;
  std::uint64_t max_upload_memory = 2ULL << 30U;
  std::uint64_t max_json_memory = 128ULL << 20U;
  std::uint64_t max_answer_memory = 1ULL << 30U;
  std::uint64_t max_head_bytes = 32 * 1024;
  std::uint64_t max_headers = 64;
  std::uint64_t max_path_bytes = 512;
  std::uint64_t head_deadline_ms = 5'000;
  std::uint64_t body_grace_ms = 10'000;
  std::uint64_t least_body_rate = 64 * 1024;
  std::uint64_t stream_write_deadline_ms = 20'000;
  std::uint64_t heartbeat_ms = 5'000;
  std::uint64_t shutdown_deadline_ms = 8'000;
  std::uint64_t token_sessions = 16;
  std::uint64_t token_samples = 40'000'000;
  std::uint64_t token_stored_bytes = 8ULL << 30U;
  std::uint64_t token_upload_bytes_per_day = 32ULL << 30U;
  std::uint64_t token_streams = 64;
  std::uint64_t token_requests_per_second = 200;
  std::uint64_t token_uploads = 16;
  std::uint64_t token_upload_file_bytes = 32ULL << 30U;
  std::uint64_t token_shares = 256;
  std::uint64_t max_tokens = 1000;
  std::uint64_t max_shares = 2048;
  std::uint64_t max_jobs = 200;
  std::uint64_t max_running_jobs = 1;
  std::uint64_t job_tile_bytes = 1ULL << 30U;
  std::uint64_t max_job_bytes = 8ULL << 30U;
  std::uint64_t job_retention_s = 7ULL * 86'400ULL;
  std::uint64_t token_jobs = 8;
  std::uint64_t token_imports = 8;
  std::uint64_t token_clouds = 32;
  std::uint64_t token_images = 32;
  friend bool operator==(const Limits&, const Limits&) = default;
};

/// One row of the table.
struct LimitInfo {
  std::string_view name;  ///< as in Limits, in the file and in /v1/info; with dashes on the command line
  std::uint64_t Limits::*member;
  std::uint64_t least;
  std::uint64_t greatest;
  std::string_view meaning;
};

std::span<const LimitInfo> limit_table();

}  // namespace pointwright::server
