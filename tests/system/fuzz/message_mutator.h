#pragma once

#include <google/protobuf/message.h>

#include <random>

namespace pepeseg::fuzz {

// Changes a field of the message or of a nested one: sets it to a value at or beyond a limit,
// clears it, adds or removes an element, or creates a nested message. The message stays parseable,
// so that inputs reach the checks after the parser, which changed bytes seldom do.
void MutateMessage(google::protobuf::Message& message, std::mt19937& random);

}  // namespace pepeseg::fuzz
