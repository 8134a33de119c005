#include "server/config/limits.h"

#include <array>

namespace pointwright::server {
namespace {

constexpr std::uint64_t kTebi = 1ULL << 40U;

constexpr std::array kTable = {
    LimitInfo{"max_upload_bytes", &Limits::max_upload_bytes, 1, kTebi, "bytes of one uploaded file"},
    LimitInfo{"max_uploads", &Limits::max_uploads, 1, 100'000, "resumable uploads held at once"},
    LimitInfo{"max_upload_file_bytes", &Limits::max_upload_file_bytes, 1, kTebi,
              "bytes of one resumable upload, on disk"},
    LimitInfo{"upload_expiry_s", &Limits::upload_expiry_s, 1, 365ULL * 86'400ULL,
              "time after the last byte until a resumable upload that was not imported is removed"},
    LimitInfo{"max_imports", &Limits::max_imports, 1, 100'000,
              "imports that clients do not wait for, held at once; those that ended longest ago make room"},
    LimitInfo{"max_samples", &Limits::max_samples, 1, 2'000'000'000, "samples of one cloud"},
    LimitInfo{"max_clouds", &Limits::max_clouds, 1, 1'000'000, "clouds held at once"},
    LimitInfo{"max_cloud_bytes", &Limits::max_cloud_bytes, 1, kTebi, "memory of all clouds together"},
    LimitInfo{"max_images", &Limits::max_images, 1, 1'000'000, "images held at once"},
    LimitInfo{"max_image_bytes", &Limits::max_image_bytes, 1, kTebi,
              "memory of all images together, pixels and files"},
    LimitInfo{"max_image_file_bytes", &Limits::max_image_file_bytes, 1, 1ULL << 31U,
              "bytes of one uploaded image"},
    LimitInfo{"max_image_side", &Limits::max_image_side, 1, 1U << 20U,
              "pixels of an image's width or height"},
    LimitInfo{"max_image_pixels", &Limits::max_image_pixels, 1, 1ULL << 30U, "pixels of one image"},
    LimitInfo{"max_sessions", &Limits::max_sessions, 1, 100'000, "sessions held at once"},
    LimitInfo{"max_session_bytes", &Limits::max_session_bytes, 1, kTebi,
              "memory of all sessions together, their histories included"},
    LimitInfo{"max_session_samples", &Limits::max_session_samples, 1, 2'000'000'000,
              "samples that resampling may bring one session to, within the memory of all sessions; at least "
              "those of its cloud"},
    LimitInfo{
        "history_bytes", &Limits::history_bytes, 1, kTebi,
        "memory of one session's history: whole states and the steps between them; others are replayed"},
    LimitInfo{"max_edits", &Limits::max_edits, 1, 1'000'000, "edits in the history of one session"},
    LimitInfo{"max_operations", &Limits::max_operations, 1, 10'000, "painting operations of one region"},
    LimitInfo{"max_painting_vertices", &Limits::max_painting_vertices, 1, 1'000'000'000,
              "vertices of strokes and outlines and balls of one region's operations"},
    LimitInfo{"max_named_regions", &Limits::max_named_regions, 0, 1'000,
              "regions of one session besides zero and one; each takes a byte a sample"},
    LimitInfo{"max_kept_answers", &Limits::max_kept_answers, 1, 100'000'000,
              "answers to requests with an Idempotency-Key that are remembered, each for a day"},
    LimitInfo{"session_idle_expiry_s", &Limits::session_idle_expiry_s, 0, 1'000'000'000,
              "time after which a session that nobody asks for is deleted, seconds; 0: never"},
    LimitInfo{"wake_wait_ms", &Limits::wake_wait_ms, 0, 600'000,
              "time that a request waits for a session that is being brought back"},
    LimitInfo{"max_json_bytes", &Limits::max_json_bytes, 256, 64ULL << 20U, "bytes of a JSON body"},
    LimitInfo{"max_recipe_bytes", &Limits::max_recipe_bytes, 256, 1ULL << 30U,
              "bytes of a recipe, or of a painting that is put back whole"},
    LimitInfo{"max_json_depth", &Limits::max_json_depth, 8, 64, "nesting of a JSON body"},
    LimitInfo{"max_connections", &Limits::max_connections, 8, 30'000, "connections served at once"},
    LimitInfo{"max_streams", &Limits::max_streams, 1, 10'000, "streams open at once"},
    LimitInfo{"max_decoders", &Limits::max_decoders, 1, 64, "uploads decoded at once"},
    LimitInfo{"max_upload_memory", &Limits::max_upload_memory, 1, kTebi,
              "bytes of all uploads that have come in and are not yet clouds or images"},
    LimitInfo{"max_json_memory", &Limits::max_json_memory, 1U << 20U, kTebi,
              "bytes of all JSON bodies that have come in and are not yet answered"},
    LimitInfo{"max_answer_memory", &Limits::max_answer_memory, 1U << 20U, kTebi,
              "bytes of all files and frames that are made or wait for slow readers; a larger one gets its "
              "turn alone"},
    LimitInfo{"max_head_bytes", &Limits::max_head_bytes, 1024, 1U << 20U, "bytes of a request's head"},
    LimitInfo{"max_headers", &Limits::max_headers, 8, 1000, "headers of a request"},
    LimitInfo{"max_path_bytes", &Limits::max_path_bytes, 128, 8192, "bytes of a request's path"},
    LimitInfo{"head_deadline_ms", &Limits::head_deadline_ms, 50, 600'000,
              "time for a request's head to arrive"},
    LimitInfo{"body_grace_ms", &Limits::body_grace_ms, 50, 3'600'000,
              "time that a body may pause; beyond it the bytes must make the least rate"},
    LimitInfo{"least_body_rate", &Limits::least_body_rate, 1000, 1ULL << 40U,
              "bytes a second that a body must make"},
    LimitInfo{"stream_write_deadline_ms", &Limits::stream_write_deadline_ms, 50, 600'000,
              "time for a stream's reader to take a piece"},
    LimitInfo{"heartbeat_ms", &Limits::heartbeat_ms, 50, 60'000, "time between the heartbeats of a stream"},
    LimitInfo{"shutdown_deadline_ms", &Limits::shutdown_deadline_ms, 100, 600'000,
              "time for running requests to end when the daemon stops"},
    LimitInfo{"token_sessions", &Limits::token_sessions, 0, 100'000,
              "sessions of one token, where it has no quota of its own"},
    LimitInfo{"token_samples", &Limits::token_samples, 0, kTebi,
              "samples of one token's sessions together, as they begin"},
    LimitInfo{"token_stored_bytes", &Limits::token_stored_bytes, 0, kTebi,
              "bytes of the uploads of one token that are kept"},
    LimitInfo{"token_upload_bytes_per_day", &Limits::token_upload_bytes_per_day, 0, kTebi,
              "bytes that one token may upload in a day"},
    LimitInfo{"token_streams", &Limits::token_streams, 0, 10'000, "streams of one token open at once"},
    LimitInfo{"token_requests_per_second", &Limits::token_requests_per_second, 1, 1'000'000,
              "requests of one token in a second, in the long run"},
    LimitInfo{"token_uploads", &Limits::token_uploads, 0, 100'000,
              "resumable uploads of one token held at once"},
    LimitInfo{"token_upload_file_bytes", &Limits::token_upload_file_bytes, 0, kTebi,
              "bytes of one token's resumable uploads together, as they are announced"},
    LimitInfo{"token_shares", &Limits::token_shares, 0, 10'000, "share links of one token"},
    LimitInfo{"max_tokens", &Limits::max_tokens, 1, 10'000, "tokens, those that have expired included"},
    LimitInfo{"max_shares", &Limits::max_shares, 0, 10'000, "share links of all sessions together"},
    LimitInfo{"max_jobs", &Limits::max_jobs, 1, 100'000, "jobs held at once, those that have ended included"},
    LimitInfo{"max_running_jobs", &Limits::max_running_jobs, 1, 64, "jobs that run at once"},
    LimitInfo{"job_tile_bytes", &Limits::job_tile_bytes, 64ULL << 20U, kTebi,
              "memory that a job in tiles keeps to"},
    LimitInfo{"max_job_bytes", &Limits::max_job_bytes, 64ULL << 20U, kTebi,
              "memory beyond which a job's worker is refused more"},
    LimitInfo{"job_retention_s", &Limits::job_retention_s, 0, 1'000'000'000,
              "time after which a job that has ended is deleted with its results, seconds; 0: never"},
    LimitInfo{"token_jobs", &Limits::token_jobs, 0, 100'000, "jobs of one token that wait or run"},
};

}  // namespace

std::span<const LimitInfo> limit_table() {
  return kTable;
}

}  // namespace pointwright::server
