#include "fdi_lio/mapping/keyframe_store.hpp"

#include <filesystem>
#include <string>
#include <utility>

#include <malloc.h>
#include <stdlib.h>
#include <unistd.h>

#include "fdi_lio/common/error.hpp"

namespace fdi_lio::mapping {

namespace {

constexpr std::size_t kFloatsPerPoint = 4;

std::size_t bytes_of(const KeyframeCloud& cloud) { return cloud.size() * sizeof(Point); }

void pack(const std::vector<Point>& points, std::vector<float>* out) {
  for (const Point& point : points)
    out->insert(out->end(), {point.position.x(), point.position.y(), point.position.z(), point.intensity});
}

std::vector<Point> unpack(const float* values, std::size_t count) {
  std::vector<Point> points(count);
  for (std::size_t k = 0; k < count; ++k, values += kFloatsPerPoint) {
    points[k].position = Eigen::Vector3f(values[0], values[1], values[2]);
    points[k].intensity = values[3];
  }
  return points;
}

}  // namespace

KeyframeStore::KeyframeStore(std::size_t memory_limit_bytes) : memory_limit_bytes_(memory_limit_bytes) {
  std::string name = (std::filesystem::temp_directory_path() / "fdi_lio_keyframes_XXXXXX").string();
  file_ = mkstemp(name.data());
  if (file_ < 0)
    throw Error("cannot make the file " + name +
                " for keyframe clouds: set TMPDIR to a folder "
                "that may be written");
  unlink(name.c_str());
}

KeyframeStore::~KeyframeStore() { close(file_); }

void KeyframeStore::add(KeyframeCloud cloud) {
  records_.emplace_back();
  set(records_.size() - 1, std::move(cloud));
}

void KeyframeStore::replace(std::size_t index, KeyframeCloud cloud) {
  Record& record = records_.at(index);
  if (record.cloud) {
    bytes_in_memory_ -= bytes_of(*record.cloud);
    recent_.erase(record.place);
  }
  set(index, std::move(cloud));
}

void KeyframeStore::set(std::size_t index, KeyframeCloud cloud) {
  Record& record = records_[index];
  record.offset.reset();
  record.surface = static_cast<std::uint32_t>(cloud.surface.size());
  record.planes = static_cast<std::uint32_t>(cloud.planes.size());
  record.edges = static_cast<std::uint32_t>(cloud.edges.size());
  keep(index, std::make_shared<const KeyframeCloud>(std::move(cloud)));
}

void KeyframeStore::write(Record* record) {
  const KeyframeCloud& cloud = *record->cloud;
  std::vector<float> values;
  values.reserve(kFloatsPerPoint * cloud.size());
  for (const auto* points : {&cloud.surface, &cloud.planes, &cloud.edges}) pack(*points, &values);
  const auto* bytes = reinterpret_cast<const char*>(values.data());
  const std::size_t size = values.size() * sizeof(float);
  for (std::size_t done = 0; done < size;) {
    const ssize_t written = pwrite(file_, bytes + done, size - done, end_ + static_cast<off_t>(done));
    if (written <= 0)
      throw Error(
          "cannot store the cloud of a keyframe: the temporary folder is full; set TMPDIR to a "
          "larger one");
    done += static_cast<std::size_t>(written);
  }
  record->offset = end_;
  end_ += static_cast<std::int64_t>(size);
}

std::shared_ptr<const KeyframeCloud> KeyframeStore::get(std::size_t index) {
  Record& record = records_.at(index);
  if (record.cloud) {
    recent_.splice(recent_.begin(), recent_, record.place);
    return record.cloud;
  }
  const std::size_t count = std::size_t{record.surface} + record.planes + record.edges;
  std::vector<float> values(kFloatsPerPoint * count);
  auto* bytes = reinterpret_cast<char*>(values.data());
  const std::size_t size = values.size() * sizeof(float);
  for (std::size_t done = 0; done < size;) {
    const ssize_t got = pread(file_, bytes + done, size - done, *record.offset + static_cast<off_t>(done));
    if (got <= 0) throw Error("cannot read the cloud of a keyframe back from the temporary folder");
    done += static_cast<std::size_t>(got);
  }
  auto cloud = std::make_shared<KeyframeCloud>();
  cloud->surface = unpack(values.data(), record.surface);
  cloud->planes = unpack(values.data() + kFloatsPerPoint * record.surface, record.planes);
  cloud->edges =
      unpack(values.data() + kFloatsPerPoint * (std::size_t{record.surface} + record.planes), record.edges);
  keep(index, cloud);
  return cloud;
}

void KeyframeStore::keep(std::size_t index, std::shared_ptr<const KeyframeCloud> cloud) {
  bytes_in_memory_ += bytes_of(*cloud);
  recent_.push_front(index);
  records_[index].cloud = std::move(cloud);
  records_[index].place = recent_.begin();
  while (bytes_in_memory_ > memory_limit_bytes_ && recent_.size() > 1) {
    Record& oldest = records_[recent_.back()];
    if (!oldest.offset) write(&oldest);
    const std::size_t bytes = bytes_of(*oldest.cloud);
    bytes_in_memory_ -= bytes;
    bytes_dropped_ += bytes;
    oldest.cloud.reset();
    recent_.pop_back();
  }
  // Clouds that come and go leave holes between what stays.
  if (bytes_dropped_ > memory_limit_bytes_ / 4) {
    malloc_trim(0);
    bytes_dropped_ = 0;
  }
}

}  // namespace fdi_lio::mapping
