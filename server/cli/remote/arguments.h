#pragma once
// What commands to a service read from their arguments, and where they put what they fetch.

#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <ostream>
#include <string>
#include <string_view>

#include "server/cli/remote/service.h"

namespace pointwright::server {

/// Numbers with commas between them; `count` of them, or any where it is 0. Throws CommandFailure (usage).
nlohmann::json numbers_of(const std::string& option, const std::string& text, std::size_t count);
/// A document: as it stands, of a file (@FILE) or of the standard input (@-). Throws CommandFailure (usage).
nlohmann::json document_argument(const std::string& option, const std::string& text);
/// "r5" or "*" for If-Match.
std::string if_match(const std::optional<std::uint64_t>& revision);

/// Writes the body of a GET into a file, whole or not at all; "-" is the standard output. Answers the bytes.
/// `expected`: how many there are, where that is known. Throws CommandFailure, also where fewer or more came.
std::uint64_t download(const RemoteService& service, HttpRequest request, const std::string& target,
                       std::ostream& out, std::optional<std::uint64_t> expected = std::nullopt);
/// The format that a file's name asks for; empty where it asks for none.
std::string format_of_target(const std::string& target);

/// A line on the terminal that is written over and over; nothing where standard error is none.
class ProgressLine {
 public:
  ProgressLine(std::ostream& err, bool is_wanted);
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;
  void show(std::string_view what, double fraction);

 private:
  std::ostream& err_;
  bool is_shown_;
  int last_ = -1;
  std::string last_what_;
};

/// Waits with growing pauses until `is_done`; false where `timeout_seconds` have passed first.
bool wait_until(const std::function<bool()>& is_done, const std::optional<double>& timeout_seconds);

}  // namespace pointwright::server
