/** Steps that the command line has today. */

const SAYS: Readonly<Record<number, { name: string; sentence: string }>> = {
  4: { name: "Compare", sentence: "goshawk compare FLIGHT shows this today: a flight beside its plan and the model." },
  5: { name: "Learn", sentence: "goshawk diagnose FLIGHT shows this today: which effects the model lacks." },
};

export function Later({ step }: { step: number }) {
  const says = SAYS[step];
  return (
    <section class="verdict">
      <h2>{says?.name}</h2>
      <p>{says?.sentence}</p>
    </section>
  );
}
