#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "google/protobuf/message.h"

// Cleans text from a worker before clients and logs get it: code that an uploaded file has taken
// over may have written it.
namespace pepeseg {

// Maximum length of a text that a client gets from a worker, bytes.
inline constexpr size_t kMaxClientText = 2048;

// Returns the length, in bytes, of the well-formed UTF-8 character at the start of `text`, which is
// not empty; 0: there is none.
size_t Utf8CharacterLength(std::string_view text);

// Returns `text` as one printable line of at most `max_bytes` bytes: absolute paths are cut to
// their last part, ends of lines become " | ", and bytes that are not UTF-8 or would control a
// terminal become '?'.
std::string ClientText(std::string_view text, size_t max_bytes = kMaxClientText);

// Returns a status with the code of `status`, its message as a ClientText, and no payloads.
absl::Status ClientStatus(const absl::Status& status);

// Replaces each string of a message, and of its nested messages, by its ClientText. Leaves maps and
// fields of bytes as they are.
void CleanTexts(google::protobuf::Message& message);

}  // namespace pepeseg
