#include "clients/cpp/option_setting.h"

#include <google/protobuf/descriptor.h>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"

namespace pepeseg::client {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::Message;

void AppendNames(const Descriptor& type, const std::string& prefix,
                 std::vector<std::string>& names) {
  for (int i = 0; i < type.field_count(); ++i) {
    const FieldDescriptor& field = *type.field(i);
    const std::string name = prefix + field.name();
    if (field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
      AppendNames(*field.message_type(), name + ".", names);
    } else {
      names.push_back(absl::StrCat(name, " (", field.cpp_type_name(), ")"));
    }
  }
}

template <typename T, typename Parse, typename Set>
bool ParseAndSet(absl::string_view text, Parse parse, Set set) {
  T value{};
  if (!parse(text, &value)) return false;
  set(value);
  return true;
}

// An enum's value by its name, which may leave out what all of them begin with: "patch".
bool SetEnum(absl::string_view text, const FieldDescriptor& field, Message& message) {
  const std::string name = absl::AsciiStrToUpper(text);
  for (int i = 0; i < field.enum_type()->value_count(); ++i) {
    const auto& value = *field.enum_type()->value(i);
    if (value.name() != name && !absl::EndsWith(value.name(), "_" + name)) continue;
    message.GetReflection()->SetEnum(&message, &field, &value);
    return true;
  }
  return false;
}

// False when the text is no value of the field's type.
bool SetField(absl::string_view text, const FieldDescriptor& field, Message& message) {
  const auto& reflection = *message.GetReflection();
  const auto with = [&](auto setter) {
    return [&, setter](auto value) { (reflection.*setter)(&message, &field, value); };
  };
  using R = google::protobuf::Reflection;
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_INT32:
      return ParseAndSet<int32_t>(text, absl::SimpleAtoi<int32_t>, with(&R::SetInt32));
    case FieldDescriptor::CPPTYPE_INT64:
      return ParseAndSet<int64_t>(text, absl::SimpleAtoi<int64_t>, with(&R::SetInt64));
    case FieldDescriptor::CPPTYPE_UINT64:
      return ParseAndSet<uint64_t>(text, absl::SimpleAtoi<uint64_t>, with(&R::SetUInt64));
    case FieldDescriptor::CPPTYPE_FLOAT:
      return ParseAndSet<float>(text, absl::SimpleAtof, with(&R::SetFloat));
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return ParseAndSet<double>(text, absl::SimpleAtod, with(&R::SetDouble));
    case FieldDescriptor::CPPTYPE_BOOL:
      return ParseAndSet<bool>(text, absl::SimpleAtob, with(&R::SetBool));
    case FieldDescriptor::CPPTYPE_ENUM:
      return SetEnum(text, field, message);
    default:
      return false;  // the options of the contract have no other type
  }
}

}  // namespace

absl::Status SetOption(absl::string_view setting, Message& options) {
  const size_t equals = setting.find('=');
  if (equals == absl::string_view::npos) {
    return absl::InvalidArgumentError(absl::StrCat(
        "--option ", setting, ": NAME=VALUE is wanted, as reconstruct.num_steps=3000"));
  }
  const absl::string_view name = setting.substr(0, equals);
  const absl::string_view value = setting.substr(equals + 1);
  Message* message = &options;
  const FieldDescriptor* field = nullptr;
  for (const absl::string_view part : absl::StrSplit(name, '.')) {
    if (field != nullptr && field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
      message = message->GetReflection()->MutableMessage(message, field);
    } else if (field != nullptr) {
      field = nullptr;
      break;
    }
    field = message->GetDescriptor()->FindFieldByName(std::string(part));
    if (field == nullptr) break;
  }
  if (field == nullptr || field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
    return absl::InvalidArgumentError(absl::StrCat("no option \"", name, "\"; there are:\n  ",
                                                   absl::StrJoin(OptionNames(options), "\n  ")));
  }
  if (!SetField(value, *field, *message)) {
    return absl::InvalidArgumentError(
        absl::StrCat("--option ", name, ": \"", value, "\" is no ", field->cpp_type_name()));
  }
  return absl::OkStatus();
}

std::vector<std::string> OptionNames(const Message& options) {
  std::vector<std::string> names;
  AppendNames(*options.GetDescriptor(), "", names);
  return names;
}

}  // namespace pepeseg::client
