#pragma once

#include <google/protobuf/message.h>

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"

namespace pepeseg::client {

// Sets a field of nested messages from text such as "reconstruct.num_steps=3000". The options are
// the fields of `options`: there is no other list of them. A value of an enum may lack the prefix
// that all of its values share ("patch"), in any case. Text is added to a list, such as
// "import.held_out_views=a.jpg". INVALID_ARGUMENT: the option is unknown (the
// message proposes similar names), or the value is not of the field's type.
absl::Status SetOption(absl::string_view setting, google::protobuf::Message& options);

// Returns every option of a message in the order of its fields: "features.learning_rate (float)".
std::vector<std::string> OptionNames(const google::protobuf::Message& options);

// Returns the values that an option of an enum type takes, such as "windows" and "patch"; empty for
// other options.
std::vector<std::string> ValueNames(absl::string_view name,
                                    const google::protobuf::Message& options);

}  // namespace pepeseg::client
