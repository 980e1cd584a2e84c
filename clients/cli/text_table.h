#pragma once

#include <google/protobuf/timestamp.pb.h>

#include <cstdint>
#include <string>
#include <vector>

#include "absl/time/time.h"

namespace pepeseg::client::cli {

using TableRow = std::vector<std::string>;

// The rows as lines, the first as the header, each column as wide as its widest cell.
std::vector<std::string> TextTable(const std::vector<TableRow>& rows);

// "40 s", "5 min", "3 h", "12 days": rounded down to the largest unit.
std::string SpanText(absl::Duration span);
// Since a time of the server's clock; negative differences of clocks are 0 s.
std::string AgeText(const google::protobuf::Timestamp& time, absl::Time now);
// "840 kB", "12.3 MB", "1.2 GB".
std::string SizeText(int64_t bytes);

absl::Time ToTime(const google::protobuf::Timestamp& time);

}  // namespace pepeseg::client::cli
