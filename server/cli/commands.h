#pragma once
// The command-line tool; main() only calls it.

#include <iosfwd>
#include <string>
#include <vector>

namespace pointwright::server {

class Team;

/// Runs `pointwright` with the arguments after its name. Returns the exit status: 0, 1 where the work failed,
/// 2 where the arguments are wrong.
/// `team`: who does `job run` together; null: this process alone
int run_command(const std::vector<std::string>& arguments, std::ostream& out, std::ostream& err,
                Team* team = nullptr);

}  // namespace pointwright::server
