#pragma once
// Which request a thread works for, so that whatever is logged on the way can say so.

#include <functional>
#include <string>
#include <utility>

namespace pointwright::server {

/// The id of the request that this thread works for; empty: for none.
inline std::string& current_request_id() {
  thread_local std::string id;
  return id;
}

/// Sets the id for as long as it lives.
class RequestScope {
 public:
  explicit RequestScope(std::string id) : before_(std::exchange(current_request_id(), std::move(id))) {}
  RequestScope(const RequestScope&) = delete;
  RequestScope& operator=(const RequestScope&) = delete;
  ~RequestScope() { current_request_id() = std::move(before_); }

 private:
  std::string before_;
};

/// Work for later, and for which request it is.
struct RequestTask {
  // NOLINTNEXTLINE(google-explicit-constructor): any task is one, for the request that this thread works for
  RequestTask(std::function<void()> work = {}) : request(current_request_id()), run(std::move(work)) {}
  std::string request;
  std::function<void()> run;
};

}  // namespace pointwright::server
