#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "clients/terminal/text_table.h"
#include "pepeseg/v1/find.pb.h"

// Text that the verbs "find" and "segment --text" print for an answer to FindSegments.
namespace pepeseg::client::cli {

// Returns "labels", "detector", "text command" or "appearance".
std::string WordOf(v1::FindSegmentsResponse::Source source);

// Returns NOT_FOUND unless something was found: "no such thing (best: 0.12 cup); did you mean ...;
// known words: ...".
absl::Status CheckFound(const v1::FindSegmentsResponse& answer);

// Returns a header and a row for each thing: its number, score, what it is, centre and size in
// scene units, the number of Gaussians, and the views that show most of it.
std::vector<TableRow> FoundRows(const v1::FindSegmentsResponse& answer);

// Returns rows as lines of comma-separated values (RFC 4180).
std::string ToCsv(const std::vector<TableRow>& rows);

}  // namespace pepeseg::client::cli
