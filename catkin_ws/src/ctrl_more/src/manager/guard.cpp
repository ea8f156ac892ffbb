#include "manager/guard.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace ctrl_more {

void Guard::configure(const std::vector<ResolvedControlUse>& uses, const ControlStates& store) {
  declared_.assign(store.dataSize(), false);
  for (const ResolvedControlUse& use : uses) {
    if (!use.use.modifies) continue;
    const CorrectionLimit& l = use.use.limit;
    const bool rated = std::isfinite(l.rate) || std::isfinite(l.angle_rate);
    const bool limited = rated || std::isfinite(l.size) || std::isfinite(l.angle);
    written_.push_back({use.signal, use.signal.offset(), total_, use.signal.size(),
                        kindOf(use.use.container), l, use.use.on_pause, limited, rated});
    total_ += use.signal.size();
    std::fill_n(declared_.begin() + use.signal.offset(), use.signal.size(), true);
  }
  for (auto* buffer : {&found_, &last_, &now_, &step_}) buffer->assign(total_, 0.0);
}

void Guard::note(const double* data) noexcept {
  for (const WrittenSignal& w : written_) {
    std::copy_n(data + w.offset, w.size, found_.data() + w.local);
  }
}

FaultKind Guard::judge(const double* data, double dt) noexcept {
  for (const WrittenSignal& w : written_) {
    if (!correction::isFinite(w.size, data + w.offset)) return FaultKind::NotFinite;
    if (!correction::isUnit(w.kind, w.size, data + w.offset)) return FaultKind::NotUnit;
  }
  for (const WrittenSignal& w : written_) {
    const FaultKind kind = w.limited ? judgeLimits(w, data, dt) : FaultKind::None;
    if (kind != FaultKind::None) return kind;
  }
  last_valid_ = true;
  return FaultKind::None;
}

FaultKind Guard::judgeLimits(const WrittenSignal& w, const double* data, double dt) noexcept {
  double* const now = now_.data() + w.local;
  double* const last = last_.data() + w.local;
  correction::difference(w.kind, w.size, found_.data() + w.local, data + w.offset, now);
  const correction::Norms size = correction::norms(w.kind, w.size, now);
  if (size.size > w.limit.size || size.angle > w.limit.angle) return FaultKind::CorrectionSize;
  if (w.rated && last_valid_) {
    double* const step = step_.data() + w.local;
    correction::difference(w.kind, w.size, last, now, step);
    const correction::Norms rate = correction::norms(w.kind, w.size, step);
    if (rate.size > w.limit.rate * dt || rate.angle > w.limit.angle_rate * dt) {
      return FaultKind::CorrectionRate;
    }
  }
  std::copy_n(now, w.size, last);
  return FaultKind::None;
}

void Guard::restore(double* data) const noexcept {
  for (const WrittenSignal& w : written_) {
    std::copy_n(found_.data() + w.local, w.size, data + w.offset);
  }
}

bool Guard::restoreUndeclared(double* data, const double* before, int size) const noexcept {
  bool changed = false;
  for (int i = 0; i < size; ++i) {
    const bool declared = i < static_cast<int>(declared_.size()) && declared_[i];
    if (declared || std::memcmp(data + i, before + i, sizeof(double)) == 0) continue;
    data[i] = before[i];
    changed = true;
  }
  return changed;
}

}  // namespace ctrl_more
