#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "google/protobuf/message.h"

// Text of a worker's, as clients and logs may have it: code that an uploaded file has taken over
// may have written it.
namespace pepeseg {

// Largest text that a client gets from a worker, bytes.
inline constexpr size_t kMaxClientText = 2048;

// Bytes of the well-formed UTF-8 character at the start of `text`, which is not empty; 0: there is
// none.
size_t Utf8CharacterLength(std::string_view text);

// `text` as one printable line of at most `max_bytes` bytes: absolute paths are cut to their last
// part, ends of lines become " | ", and what is not UTF-8 or would steer a terminal becomes '?'.
std::string ClientText(std::string_view text, size_t max_bytes = kMaxClientText);

// `status` with its message as a ClientText and nothing else.
absl::Status ClientStatus(const absl::Status& status);

// Makes each text of a message a ClientText, also in its parts. Keys of maps stay as they are.
void CleanTexts(google::protobuf::Message& message);

}  // namespace pepeseg
