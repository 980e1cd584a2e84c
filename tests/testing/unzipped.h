#pragma once

#include <map>
#include <string>

#include "absl/strings/string_view.h"

namespace pepeseg::testing {

// Returns the files of a zip by name, as its directory lists them. Records that are malformed or
// contradict each other, sizes and checksums that are wrong and names that repeat are failures of
// the test.
std::map<std::string, std::string> Unzipped(absl::string_view zip);

}  // namespace pepeseg::testing
