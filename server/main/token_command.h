#pragma once
// pointwrightd token add, list and revoke: the operator's hand on the file of tokens.

#include <iosfwd>
#include <string>
#include <vector>

namespace pointwright::server {

/// Runs the arguments after "token". The file is --tokens FILE, or tokens.json of --data DIR; `add` makes it
/// where it is not there. A new token goes to `out`, alone on its line, this once. Returns the exit status.
int run_token_command(const std::vector<std::string>& arguments, std::ostream& out, std::ostream& err);

}  // namespace pointwright::server
