/** The buttons that fill what a project lacks; the same ones wherever it is said that something is missing. */

import { FileButton } from "../../components/FileButton";
import { connected, files } from "../../core/store";
import { LOGS, takeFile } from "../compare/flights";
import { openAddress, openForm, SHAPES, takeAny } from "./fill";

export function MapButtons() {
  return (
    <>
      <FileButton name="Import a map" kinds={SHAPES} primary onFile={(file) => void takeAny(file)} />
      <FormButton kind="map" name="From images" />
    </>
  );
}

export function VehicleButtons() {
  return (
    <>
      <FormButton kind="new_vehicle" name="From a data sheet" primary />
      <FormButton kind="example_vehicle" name="An example" />
    </>
  );
}

export function FlightButtons() {
  return <FileButton name="Import log" kinds={LOGS} primary onFile={(file) => void takeFile(file)} />;
}

export function LinkButtons() {
  return (
    <>
      <FormButton kind="simulate" name="Start the simulator" primary disabled={!files.value.has_vehicle} />
      <button type="button" class="control" disabled={!connected.value} onClick={openAddress}>
        Connect to an address
      </button>
    </>
  );
}

interface FormButtonProps {
  kind: string;
  name: string;
  primary?: boolean;
  disabled?: boolean;
}

function FormButton({ kind, name, primary = false, disabled = false }: FormButtonProps) {
  return (
    <button
      type="button"
      class={`control ${primary ? "primary" : ""}`}
      disabled={!connected.value || disabled}
      onClick={() => openForm(kind)}
    >
      {name}
    </button>
  );
}
