#pragma once

#include <google/protobuf/message.h>

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace pepeseg::client {

// Sets a field of nested messages from text: "reconstruct.num_steps=3000". The contract is the only
// list of options there is. INVALID_ARGUMENT names an unknown option, with those that may be meant,
// or a value that is not of the field's type.
absl::Status SetOption(absl::string_view setting, google::protobuf::Message& options);

// "features.learning_rate (float)", ...: every option of a message, in its order.
std::vector<std::string> OptionNames(const google::protobuf::Message& options);

// The names that an option of an enum takes, as "windows", "patch"; empty for other options.
std::vector<std::string> ValueNames(absl::string_view name,
                                    const google::protobuf::Message& options);

}  // namespace pepeseg::client
