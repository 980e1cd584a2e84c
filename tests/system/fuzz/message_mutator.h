#pragma once

#include <google/protobuf/message.h>

#include <random>

namespace pepeseg::fuzz {

// Changes a field of the message, or of one inside it: sets it to a value at or beyond some limit,
// clears it, adds or removes an element, makes a part. The message keeps its type, so that checks
// behind the parser are reached, which changed bytes seldom do.
void MutateMessage(google::protobuf::Message& message, std::mt19937& random);

}  // namespace pepeseg::fuzz
