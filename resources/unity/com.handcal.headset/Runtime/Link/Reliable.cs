using System;
using System.Collections.Generic;

namespace Handcal.Link
{
    /// <summary>The delivery state of a reliable message.</summary>
    public enum Delivery
    {
        Pending,
        Acked,
        Superseded,
        Failed,
    }

    /// <summary>A reliable message on its way; <see cref="State"/> says whether it has arrived.</summary>
    public sealed class Outgoing
    {
        internal readonly Slot Slot;
        internal readonly uint MessageId;
        internal readonly byte[] Message;
        internal readonly bool[] IsArrived;
        internal readonly double DeadlineS;
        internal double ResendAtS, BackoffS;

        internal Outgoing(Slot slot, uint id, byte[] message, double nowS)
        {
            int count = Math.Max(1, (message.Length + Datagram.MaxPayloadBytes - 1) / Datagram.MaxPayloadBytes);
            if (count > Datagram.MaxFragments) throw new ArgumentException("the message is too large");
            Slot = slot;
            MessageId = id;
            Message = message;
            IsArrived = new bool[count];
            DeadlineS = nowS + Outbox.GiveUpS;
            ResendAtS = nowS;
            BackoffS = Outbox.ResendS;
        }

        public Delivery State { get; internal set; }
    }

    /// <summary>The sender's half of protocol.md, "Reliable messages".</summary>
    sealed class Outbox
    {
        public const double ResendS = 0.04, ResendMaxS = 0.64, GiveUpS = 5.0;
        readonly Dictionary<Slot, Outgoing> newest = new Dictionary<Slot, Outgoing>();
        uint nextId = 1;

        /// <summary>Queues a message in place of the slot's older one.</summary>
        public Outgoing Send(Slot slot, byte[] message, double nowS)
        {
            if (newest.TryGetValue(slot, out Outgoing older) && older.State == Delivery.Pending)
                older.State = Delivery.Superseded;
            return newest[slot] = new Outgoing(slot, nextId++, message, nowS);
        }

        /// <summary>Sends every fragment that is due; gives up messages whose time is over.</summary>
        public void SendDue(double nowS, Action<Packet> send)
        {
            foreach (Outgoing message in newest.Values)
            {
                if (message.State != Delivery.Pending) continue;
                if (nowS >= message.DeadlineS) message.State = Delivery.Failed;
                else if (nowS >= message.ResendAtS)
                {
                    for (int i = 0; i < message.IsArrived.Length; i++)
                        if (!message.IsArrived[i]) send(Fragment(message, i));
                    message.ResendAtS = nowS + message.BackoffS;
                    message.BackoffS = Math.Min(2 * message.BackoffS, ResendMaxS);
                }
            }
        }

        /// <summary>Reads an Ack; a receipt for no pending message is ignored.</summary>
        public void Acknowledge(ProtoReader ack)
        {
            while (ack.Next(out int field))
                if (field == 1) TakeReceipt(ack.Message());
        }

        void TakeReceipt(ProtoReader receipt)
        {
            ulong slot = 0, id = 0;
            byte[] bits = new byte[0];
            while (receipt.Next(out int field))
            {
                if (field == 1) slot = receipt.Number();
                else if (field == 2) id = receipt.Number();
                else if (field == 3) bits = receipt.Bytes();
            }
            if (slot > byte.MaxValue || !newest.TryGetValue((Slot)slot, out Outgoing message)) return;
            if (message.MessageId != id || message.State != Delivery.Pending) return;
            bool isComplete = true;
            for (int i = 0; i < message.IsArrived.Length; i++)
            {
                if (i / 8 < bits.Length && (bits[i / 8] >> i % 8 & 1) == 1 && !message.IsArrived[i])
                {
                    message.IsArrived[i] = true;
                    message.BackoffS = ResendS;
                }
                isComplete &= message.IsArrived[i];
            }
            if (isComplete) message.State = Delivery.Acked;
        }

        static Packet Fragment(Outgoing message, int index)
        {
            int start = index * Datagram.MaxPayloadBytes;
            return new Packet
            {
                Slot = message.Slot,
                MessageId = message.MessageId,
                Fragment = index,
                FragmentCount = message.IsArrived.Length,
                Bytes = message.Message,
                Start = start,
                Count = Math.Min(Datagram.MaxPayloadBytes, message.Message.Length - start),
            };
        }
    }

    /// <summary>The receiver's half: joins fragments, and owes receipts for them.</summary>
    sealed class Inbox
    {
        const int ReceiptCopies = 3;
        readonly Dictionary<Slot, Incoming> newest = new Dictionary<Slot, Incoming>();

        sealed class Incoming
        {
            public uint MessageId;
            public byte[][] Fragments;
            public int Missing, Owed;
        }

        /// <summary>Adds a fragment; returns its message if that completes it, else null.</summary>
        public byte[] Receive(Packet packet)
        {
            newest.TryGetValue(packet.Slot, out Incoming message);
            if (message == null || packet.MessageId > message.MessageId)
            {
                message = new Incoming
                {
                    MessageId = packet.MessageId,
                    Fragments = new byte[packet.FragmentCount][],
                    Missing = packet.FragmentCount,
                };
                newest[packet.Slot] = message;
            }
            bool isOfMessage = packet.MessageId == message.MessageId
                && packet.FragmentCount == message.Fragments.Length;
            if (!isOfMessage) return null;
            message.Owed = ReceiptCopies;
            OwesReceipts = true;
            if (message.Fragments[packet.Fragment] != null) return null;
            var payload = new byte[packet.Count];
            Buffer.BlockCopy(packet.Bytes, packet.Start, payload, 0, packet.Count);
            message.Fragments[packet.Fragment] = payload;
            return --message.Missing == 0 ? Join(message.Fragments) : null;
        }

        public bool OwesReceipts { get; private set; }

        /// <summary>The receipts to send now; each is sent three times.</summary>
        public List<ProtoWriter> TakeReceipts()
        {
            var receipts = new List<ProtoWriter>();
            OwesReceipts = false;
            foreach (KeyValuePair<Slot, Incoming> one in newest)
            {
                if (one.Value.Owed == 0) continue;
                OwesReceipts |= --one.Value.Owed > 0;
                receipts.Add(Receipt(one.Key, one.Value));
            }
            return receipts;
        }

        static ProtoWriter Receipt(Slot slot, Incoming message)
        {
            var bits = new byte[Datagram.MaxFragments / 8];
            int used = 0;
            for (int i = 0; i < message.Fragments.Length; i++)
            {
                if (message.Fragments[i] == null) continue;
                bits[i / 8] |= (byte)(1 << i % 8);
                used = i / 8 + 1;
            }
            Array.Resize(ref bits, used);
            return new ProtoWriter().Number(1, (ulong)slot).Number(2, message.MessageId).Bytes(3, bits);
        }

        /// <summary>Joins the fragments and empties them, so that only the receipt is kept.</summary>
        static byte[] Join(byte[][] fragments)
        {
            int size = 0;
            foreach (byte[] fragment in fragments) size += fragment.Length;
            var whole = new byte[size];
            int at = 0;
            for (int i = 0; i < fragments.Length; i++)
            {
                Buffer.BlockCopy(fragments[i], 0, whole, at, fragments[i].Length);
                at += fragments[i].Length;
                fragments[i] = new byte[0];
            }
            return whole;
        }
    }
}
