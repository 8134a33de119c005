#pragma once
// Who makes room where a table is full: nobody can push others out of it.

#include <cstddef>
#include <map>
#include <string>

namespace pointwright::server {

/// Of the entries that may go: one of the owner who holds most of all, and of these the one that ended
/// longest ago. Null where none may go.
/// `owner`: of an entry; `may_go`: whether it has ended; `ended`: when
template <typename Entries, typename Owner, typename MayGo, typename Ended>
typename Entries::value_type displaced(const Entries& entries, Owner owner, MayGo may_go, Ended ended) {
  std::map<std::string, std::size_t> held;
  for (const auto& entry : entries) ++held[owner(*entry)];
  typename Entries::value_type chosen;
  for (const auto& entry : entries) {
    if (!may_go(*entry)) continue;
    const std::size_t theirs = held[owner(*entry)];
    const std::size_t most = chosen == nullptr ? 0 : held[owner(*chosen)];
    if (theirs > most || (theirs == most && ended(*entry) < ended(*chosen))) chosen = entry;
  }
  return chosen;
}

}  // namespace pointwright::server
