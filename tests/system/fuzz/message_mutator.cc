#include "tests/system/fuzz/message_mutator.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "tests/system/fuzz/byte_mutator.h"

namespace pepeseg::fuzz {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

constexpr int kMaxDepth = 6;

double AnyNumber(std::mt19937& random) {
  using Limits = std::numeric_limits<double>;
  constexpr std::array<double, 18> kNumbers = {0,
                                               -0.0,
                                               1,
                                               -1,
                                               0.5,
                                               2,
                                               31.5,
                                               32,
                                               95.999,
                                               96,
                                               1e-9,
                                               1e9,
                                               1e300,
                                               -1e300,
                                               Limits::infinity(),
                                               -Limits::infinity(),
                                               Limits::quiet_NaN(),
                                               Limits::denorm_min()};
  return kNumbers[Below(kNumbers.size(), random)];
}

int64_t AnyInteger(std::mt19937& random) {
  constexpr std::array<int64_t, 16> kIntegers = {0,
                                                 1,
                                                 -1,
                                                 2,
                                                 3,
                                                 16,
                                                 17,
                                                 100,
                                                 1001,
                                                 65'536,
                                                 50'000'001,
                                                 std::numeric_limits<int32_t>::max(),
                                                 std::numeric_limits<int32_t>::min(),
                                                 int64_t{1} << 40,
                                                 std::numeric_limits<int64_t>::max(),
                                                 std::numeric_limits<int64_t>::min()};
  return kIntegers[Below(kIntegers.size(), random)];
}

std::string AnyText(const std::string& now, std::mt19937& random) {
  const std::vector<std::string> texts = {"",
                                          "x",
                                          "..",
                                          "scenes/shelf",
                                          "scenes/shelf/models/live",
                                          "scenes/shelf/models/1",
                                          "scenes/shelf/datasets/1",
                                          "scenes/shelf/uploads/1",
                                          "scenes/shelf/labels/red",
                                          "scenes/shelf/selections/1",
                                          "jobs/j1",
                                          "middle.jpg",
                                          "left/0.jpg",
                                          "front",
                                          std::string(300, 'a'),
                                          std::string("\xff\0", 2)};
  if (now.empty() || Below(2, random) == 0) return texts[Below(texts.size(), random)];
  std::string text = now;
  const size_t at = Below(text.size(), random);
  switch (Below(3, random)) {
    case 0:
      text[at] = static_cast<char>(Below(256, random));
      break;
    case 1:
      text.erase(at, 1);
      break;
    default:
      text.insert(at, 1, static_cast<char>(Below(128, random)));
  }
  return text;
}

// Sets a scalar field, or adds an element to a repeated one.
void PutScalar(Message& message, const FieldDescriptor* field, std::mt19937& random) {
  const Reflection* at = message.GetReflection();
  const bool add = field->is_repeated();
  const auto put = [&](auto value, auto setter, auto adder) {
    add ? (at->*adder)(&message, field, value) : (at->*setter)(&message, field, value);
  };
  switch (field->cpp_type()) {
    case FieldDescriptor::CPPTYPE_INT32:
      return put(static_cast<int32_t>(AnyInteger(random)), &Reflection::SetInt32,
                 &Reflection::AddInt32);
    case FieldDescriptor::CPPTYPE_UINT32:
      return put(static_cast<uint32_t>(AnyInteger(random)), &Reflection::SetUInt32,
                 &Reflection::AddUInt32);
    case FieldDescriptor::CPPTYPE_INT64:
      return put(AnyInteger(random), &Reflection::SetInt64, &Reflection::AddInt64);
    case FieldDescriptor::CPPTYPE_UINT64:
      return put(static_cast<uint64_t>(AnyInteger(random)), &Reflection::SetUInt64,
                 &Reflection::AddUInt64);
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return put(AnyNumber(random), &Reflection::SetDouble, &Reflection::AddDouble);
    case FieldDescriptor::CPPTYPE_FLOAT: {
      const double number = std::fmin(std::fmax(AnyNumber(random), -3e38), 3e38);
      return put(static_cast<float>(number), &Reflection::SetFloat, &Reflection::AddFloat);
    }
    case FieldDescriptor::CPPTYPE_BOOL:
      return put(Below(2, random) == 0, &Reflection::SetBool, &Reflection::AddBool);
    case FieldDescriptor::CPPTYPE_ENUM:
      return put(static_cast<int>(Below(12, random)), &Reflection::SetEnumValue,
                 &Reflection::AddEnumValue);
    case FieldDescriptor::CPPTYPE_STRING: {
      std::string text = add ? "" : at->GetString(message, field);
      text = AnyText(text, random);
      // Protobuf's parser refuses text that is not UTF-8.
      if (field->type() == FieldDescriptor::TYPE_STRING) {
        for (char& c : text) c = static_cast<char>(c & 0x7f);
      }
      return put(text, &Reflection::SetString, &Reflection::AddString);
    }
    default:
      return;
  }
}

void Mutate(Message& message, std::mt19937& random, int depth);

void MutatePart(Message& message, const FieldDescriptor* field, std::mt19937& random, int depth) {
  const Reflection* at = message.GetReflection();
  if (depth >= kMaxDepth) return;
  if (!field->is_repeated()) return Mutate(*at->MutableMessage(&message, field), random, depth + 1);
  const int size = at->FieldSize(message, field);
  if (size == 0 || Below(4, random) == 0) {
    return Mutate(*at->AddMessage(&message, field), random, depth + 1);
  }
  const auto index = static_cast<int>(Below(static_cast<size_t>(size), random));
  Mutate(*at->MutableRepeatedMessage(&message, field, index), random, depth + 1);
}

void Mutate(Message& message, std::mt19937& random, int depth) {
  const auto* type = message.GetDescriptor();
  if (type->field_count() == 0) return;
  const auto index = static_cast<int>(Below(static_cast<size_t>(type->field_count()), random));
  const FieldDescriptor* field = type->field(index);
  const Reflection* at = message.GetReflection();
  if (Below(8, random) == 0) {
    at->ClearField(&message, field);
  } else if (field->is_repeated() && at->FieldSize(message, field) > 0 && Below(4, random) == 0) {
    at->RemoveLast(&message, field);
  } else if (field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE) {
    MutatePart(message, field, random, depth);
  } else {
    PutScalar(message, field, random);
  }
}

}  // namespace

void MutateMessage(Message& message, std::mt19937& random) {
  for (size_t i = 0; i <= Below(3, random); ++i) Mutate(message, random, 0);
}

}  // namespace pepeseg::fuzz
