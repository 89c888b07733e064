"""Recorded flights: what each is for, their streams over time, logs that are dropped, fixed, discarded."""

from gcs_web.desk import Desk
from gcs_web.flights import aligning
from gcs_web.panels.handlers import Handlers
from gcs_web.protocol import flights as messages
from gcs_web.protocol.people import Person
from gcs_web.protocol.reply import Reply


def _list(desk: Desk, _: Person, __: messages.ListFlights) -> None:
    desk.flights.refresh()


def _set_role(desk: Desk, _: Person, wanted: messages.SetRole) -> None:
    desk.flights.set_role(wanted.flight, wanted.role)


def _set_note(desk: Desk, _: Person, wanted: messages.SetNote) -> None:
    desk.flights.set_note(wanted.flight, wanted.note.strip())


def _rename(desk: Desk, _: Person, wanted: messages.RenameFlight) -> Reply:
    name = desk.flights.rename(wanted.flight, wanted.name)
    desk.notice(f"{wanted.flight} is called {name} now.")
    return Reply(wanted.serial, name=name)


def _open(desk: Desk, _: Person, wanted: messages.OpenFlights) -> Reply:
    return Reply(wanted.serial, flights=[desk.comparing.opened(name, wanted.formulas) for name in wanted.flights])


def _align(desk: Desk, _: Person, wanted: messages.AlignFlights) -> Reply:
    return Reply(wanted.serial, aligned=aligning.align(desk.flights.recorded, wanted.flights, wanted.by))


def _read(desk: Desk, _: Person, wanted: messages.ReadStreams) -> Reply:
    parts = desk.comparing.read(wanted.flight, wanted.streams, wanted.from_s, wanted.to_s, wanted.points)
    return Reply(wanted.serial, parts=parts)


def _spectrum(desk: Desk, _: Person, wanted: messages.ReadSpectrum) -> Reply:
    found = desk.comparing.spectrum(wanted.flight, wanted.stream, wanted.from_s, wanted.to_s)
    return Reply(wanted.serial, spectrum=found)


def _spectrogram(desk: Desk, _: Person, wanted: messages.ReadSpectrogram) -> Reply:
    found = desk.comparing.spectrogram(wanted.flight, wanted.stream, wanted.from_s, wanted.to_s)
    return Reply(wanted.serial, spectrogram=found)


def _pairs(desk: Desk, _: Person, wanted: messages.ReadPairs) -> Reply:
    found = desk.comparing.pairs(wanted.flight, (wanted.x, wanted.y), wanted.from_s, wanted.to_s)
    return Reply(wanted.serial, pairs=found)


def _fix(desk: Desk, _: Person, wanted: messages.FixFlight) -> Reply:
    name, done = desk.flights.fix(wanted.flight, wanted.only)
    desk.notice(f"{wanted.flight}: {'; '.join(done)}. Saved as {name}; {wanted.flight} stays as it is, left out.")
    return Reply(wanted.serial, name=name)


def _discard(desk: Desk, _: Person, wanted: messages.DiscardFlight) -> Reply:
    kept = desk.flights.discard(wanted.flight)
    desk.notice(f"{wanted.flight} discarded; it is kept as {kept}.")
    return Reply(wanted.serial, name=kept)


def _restore(desk: Desk, _: Person, wanted: messages.RestoreFlight) -> Reply:
    name = desk.flights.restore(wanted.kept)
    desk.notice(f"{name} is back.")
    return Reply(wanted.serial, name=name)


def _take(desk: Desk, _: Person, wanted: messages.TakeLog) -> Reply:
    if wanted.column_map:
        taken = desk.flights.take_with_map(wanted.file, wanted.column_map)
    else:
        taken = desk.flights.take(wanted.file)
    if not isinstance(taken, str):
        return Reply(wanted.serial, incoming=taken)
    desk.notice(f"{wanted.file} imported as {taken}.")
    return Reply(wanted.serial, name=taken)


HANDLERS: Handlers = {
    messages.ListFlights: _list,
    messages.SetRole: _set_role,
    messages.SetNote: _set_note,
    messages.RenameFlight: _rename,
    messages.OpenFlights: _open,
    messages.AlignFlights: _align,
    messages.ReadStreams: _read,
    messages.ReadSpectrum: _spectrum,
    messages.ReadSpectrogram: _spectrogram,
    messages.ReadPairs: _pairs,
    messages.FixFlight: _fix,
    messages.DiscardFlight: _discard,
    messages.RestoreFlight: _restore,
    messages.TakeLog: _take,
}
